"""The command ``reach``: which robot's arm reaches which node, with how many postures."""

from __future__ import annotations

from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt._files import csv_text
from seqopt.arms._permits import reach, reach_described
from seqopt.work import Tell


def run(asked: Annotated[Call, ("call", reach)], *, out: Folder = None, progress: Tell) -> Answer:
    """Say which arms reach which nodes, with how many postures, and up to how many bricks.

    Robots have arms in the scene file; the extra arms computes postures.

    Parameters
    ----------
    out : pathlib.Path, optional
        Folder to write reach.csv to.

    Examples
    --------
    $ seqopt reach my.json --out reach
    $ seqopt reach my.json --cache postures --json
    """
    found, output = asked.values()["scene"], Output(out, asked.words.get("scene"))
    output.require()
    if not found.has_arms:
        said = f"no robot of {found.name} has an arm; seqopt scene says how far each reaches"
        return Answer({"reach": []}, wrapped(said), scene=found)
    table = asked(scene=found, progress=progress)
    written = output.write(progress, lambda: {"reach.csv": csv_text(table)})
    hint = "--out DIR writes a row for every robot and node"
    lines = [*reach_described(found, table), f"written to {out}: reach.csv" if written else hint]
    return Answer({"reach": table}, "\n".join(map(wrapped, lines)), scene=found, written=written)
