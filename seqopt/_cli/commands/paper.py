"""The command ``paper``: the tables and figures of Bruun et al. beside the printed ones."""

from __future__ import annotations

import argparse

from seqopt._cli.answer import Answer
from seqopt._cli.options import WRITTEN, declare, form_options
from seqopt._cli.outputs import figure_notes, require_out, write_outputs
from seqopt._cli.screens import question
from seqopt._cli.terminal import wrapped
from seqopt._paper.files import PAGE, agreement_lines, agreement_table, counterparts, paper_files

DESCRIPTION = (
    "Compute every figure and table of Bruun et al. (arXiv 2104.04856) that has numbers anew, and "
    "say how far each is from what they print."
)
EXAMPLES = ("seqopt paper", "seqopt paper --out paper")
OUT = {
    "--out DIR": "folder to write to: tables with printed and computed values, figures (need "
    "matplotlib), and a page that lists them"
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``paper``."""
    declare(question(command, WRITTEN), OUT)
    form_options(command)
    command.set_defaults(scene="arch25")


def run(options: argparse.Namespace) -> Answer:
    """Set the paper's numbers beside ours, and write them if asked."""
    require_out(options)
    own, table = counterparts(options.tell)
    written = write_outputs(options, lambda: paper_files(own, table, options.tell))
    lines = [wrapped(line, first="- ") for line in agreement_lines(table)]
    lines.append(
        f"written to {options.out}; {options.out / PAGE} lists what is in it"
        if written
        else "--out DIR writes all values, and figures"
    )
    return Answer(
        facts={"items": agreement_table(table), "values": table},
        text="\n".join(lines),
        written=written,
        notes=figure_notes() if written else (),
    )
