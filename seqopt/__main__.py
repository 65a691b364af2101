"""Run the command line as ``python -m seqopt``, or as the program ``seqopt``."""

import sys

from seqopt._cli.start import run

__all__ = ["run"]

if __name__ == "__main__":
    sys.exit(run())
