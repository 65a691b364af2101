"""The command ``reach``: which robot reaches which node, by its region or by its arm."""

from __future__ import annotations

from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt.arms._permits import reach, reach_described, reached_by_region
from seqopt.exchange._files import Output, csv_text
from seqopt.work import Tell


def run(asked: Annotated[Call, ("call", reach)], *, out: Folder = None, progress: Tell) -> Answer:
    """Say which robots reach which nodes; arms with how many postures, up to how many bricks.

    Robots have a reach or an arm in the scene file; the extra arms computes postures.

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
    table, lines = reached_by_region(found)
    if found.has_arms:
        table = asked(scene=found, progress=progress)
        lines += reach_described(found, table)
    written = output.write(progress, lambda: {"reach.csv": csv_text(table)})
    hint = "--out DIR writes a row for every robot and node"
    lines.append(f"written to {out}: reach.csv" if written else hint)
    return Answer({"reach": table}, "\n".join(map(wrapped, lines)), scene=found, written=written)
