"""The command ``reach``: which robot's arm reaches which node, with how many postures."""

from __future__ import annotations

import pandas as pd

from seqopt._cli import inputs, options, outputs
from seqopt._cli.answer import Answer
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt.arms._permits import (
    find_table,
    reach_covered,
    reach_described,
    reach_table,
    reach_without_arms,
)
from seqopt.arms.reach import find_postures
from seqopt.scene.scene import Scene


class Reach(options.Written, options.Postures, options.Built):
    """What is written and printed?

    out : DIR
        folder to write reach.csv, postures.csv and a picture to
    """


def run(asked: Reach) -> Answer:
    """Say which robots reach which nodes.

    Of those with arms, with how many postures, and up to how many bricks. Robots have arms in the
    scene file; the extra arms computes postures.

    Examples
    --------
    seqopt reach my.json --out reach
    seqopt reach my.json --cache postures --json
    """
    scene = inputs.find_scene(asked)
    outputs.require_out(asked)
    find_postures(scene, asked.cache, asked.tell)
    table = reach_table(scene) if scene.has_arms else reach_without_arms(scene)
    written = outputs.write_outputs(asked, lambda: _files(scene, table))
    lines = [*(reach_described if scene.has_arms else reach_covered)(scene, table)]
    if written:
        names = "reach.csv, postures.csv" if scene.has_arms else "reach.csv"
        lines.append(f"written to {asked.path}: {names}")
    else:
        lines.append("--out DIR writes a row for every robot and node, and postures of arms")
    return Answer(
        {"reach": table},
        scene=scene,
        text="\n".join(map(wrapped, lines)),
        written=written,
        value=table,
    )


def _files(scene: Scene, table: pd.DataFrame) -> dict[str, bytes | str]:
    """Return the tables by file name."""
    files: dict[str, bytes | str] = {"reach.csv": csv_text(table)}
    if scene.has_arms:
        files["postures.csv"] = csv_text(find_table(scene).table())
    return files
