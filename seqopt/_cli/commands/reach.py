"""The command ``reach``: which robot's arm reaches which node, with how many postures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from seqopt._cli.answer import Answer
from seqopt._cli.asked import asked_scene, scene_facts
from seqopt._cli.options import Built, Postures
from seqopt._cli.outputs import figure_notes, require_out, write_outputs
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt.arms._permits import find_table, reach_table
from seqopt.arms.reach import find_postures
from seqopt.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Reach(Postures, Built):
    """Say which robots reach which nodes.

    Of those with arms, with how many postures, and up to how many bricks. Robots have arms in the
    scene file; the extra arms computes postures.

    What is written and printed?
    out : DIR
        folder to write reach.csv, postures.csv and a picture to

    Examples
    --------
    seqopt reach my.json --out reach
    seqopt reach my.json --cache postures --json
    """


def run(asked: Reach) -> Answer:
    """Say what arms reach, and write it if asked."""
    scene = asked_scene(asked)
    require_out(asked)
    find_postures(scene, asked.cache, asked.tell)
    table = reach_table(scene) if scene.has_arms else _without_arms(scene)
    written = write_outputs(asked, lambda: _files(scene, table))
    lines = [*(_described if scene.has_arms else _covered)(scene, table)]
    if written:
        names = "reach.csv, postures.csv" if scene.has_arms else "reach.csv"
        lines.append(f"written to {asked.out}: {names}")
    else:
        lines.append("--out DIR writes a row for every robot and node, and postures of arms")
    return Answer(
        facts={"scene": scene_facts(scene), "reach": table},
        text="\n".join(map(wrapped, lines)),
        written=written,
        notes=figure_notes() if written and scene.has_arms else (),
    )


def _files(scene: Scene, table: pd.DataFrame) -> dict[str, bytes | str]:
    """Return the tables, and the picture if it can be drawn, by file name."""
    files: dict[str, bytes | str] = {"reach.csv": csv_text(table)}
    if not scene.has_arms:
        return files
    files["postures.csv"] = csv_text(find_table(scene).table())
    if figure_notes():
        return files
    from seqopt.report._pictures import reach_picture  # noqa: PLC0415  # matplotlib is an extra
    from seqopt.report._style import picture_files  # noqa: PLC0415

    return files | picture_files("reach", reach_picture(table))


def _without_arms(scene: Scene) -> pd.DataFrame:
    """Return which nodes lie within the reach of each robot, a row for each."""
    rows = (
        {"robot": robot.name, "brick": brick.name, "node": node, "reached": node in reached}
        for robot in scene.robots
        for brick, reached in zip(scene.placed, scene.within_reach(robot), strict=True)
        for node in brick.nodes
        if node not in scene.blocked_nodes
    )
    return pd.DataFrame(rows)


def _covered(scene: Scene, table: pd.DataFrame) -> Iterator[str]:
    """Yield how much lies within the reach of each robot, none of which has an arm."""
    yield f"no robot of {scene.name} has an arm: this is the reach that the scene gives them"
    for robot, (_, rows) in zip(scene.robots, table.groupby("robot", sort=False), strict=True):
        yield f"{robot.name}: reach {robot.reach}, {rows['reached'].sum()} of {len(rows)} nodes"
        lacking = [str(node) for node in rows["node"][~rows["reached"]]]
        if lacking:
            yield f"  never: {_listed(lacking)}"


def _described(scene: Scene, table: pd.DataFrame) -> Iterator[str]:
    """Yield what each robot reaches, in words."""
    free = [node for node in table["node"].unique() if node not in scene.blocked_nodes]
    last = len(scene.bricks)
    for name, rows in table[table["node"].isin(free)].groupby("robot", sort=False):
        able = rows[rows["to_bricks"] > 0]
        to_end = able[able["to_bricks"] == last]
        yield (
            f"{name}: reaches {len(able)} of {len(free)} nodes when their bricks are placed, "
            f"{len(to_end)} of them up to the last brick; "
            f"{able['postures'].median() if len(able) else 0:g} postures at a node, by the median"
        )
        for why, lacking in rows[rows["to_bricks"] == 0].groupby("why", sort=False):
            yield f"  never: {_listed([*map(str, lacking['node'])])} ({why})"
        early = able[able["to_bricks"] < last]
        if len(early):
            pairs = zip(early["node"], early["to_bricks"], strict=True)
            yield f"  up to fewer bricks: {_listed([f'{n} ({to})' for n, to in pairs])}"


def _listed(names: list[str], most: int = 30) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
