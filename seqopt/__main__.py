"""Run the command line as ``python -m seqopt``."""

import sys

from seqopt.cli.main import main

sys.exit(main())
