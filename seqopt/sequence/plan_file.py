"""Plans: a given sequence of steps, read from CSV with the first columns of Table A.1."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from seqopt.errors import StepError
from seqopt.files import read_text
from seqopt.scene.checks import short, whole
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind, check_sequence

Row = dict[str, str]


def read_plan(scene: Scene, path: Path) -> tuple[Step, ...]:
    r"""Return the checked steps of a plan file.

    Parameters
    ----------
    scene : Scene
        In which every step must be possible.
    path : pathlib.Path
        CSV; see `parse_plan` for its columns.

    Returns
    -------
    tuple of Step
        Numbered from 1.

    Raises
    ------
    FileError
        If the file cannot be read.
    StepError
        If it is no such table or a step is impossible.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import seqopt
    >>> text = "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "plan.csv"
    ...     _ = path.write_text(text)
    ...     steps = seqopt.read_plan(seqopt.load_scene("arch25"), path)
    >>> steps[0].bricks, steps[0].held
    (1, (1,))
    """
    return parse_plan(scene, read_text(path), str(path))


def parse_plan(scene: Scene, text: str, source: str) -> tuple[Step, ...]:
    """Return the checked steps of a plan.

    Parameters
    ----------
    scene : Scene
        In which every step must be possible.
    text : str
        CSV with the columns ``step``, ``type``, ``bricks`` and, for every robot, ``NAME_node`` and,
        if present, ``NAME_brick``; an empty cell means that the robot does not grip. Other columns
        are ignored.
    source : str
        What to call the plan in messages.

    Returns
    -------
    tuple of Step
        Numbered from 1.

    Raises
    ------
    StepError
        If the text is not such a table or a step is impossible.
    """
    try:
        return _steps(scene, csv.DictReader(io.StringIO(text), restval=""), source)
    except csv.Error as error:
        raise StepError(f"plan {source}: no CSV that can be read: {error}") from error


def _steps(scene: Scene, reader: csv.DictReader[str], source: str) -> tuple[Step, ...]:
    wanted = ["step", "type", "bricks", *(f"{robot.name}_node" for robot in scene.robots)]
    missing = [column for column in wanted if column not in (reader.fieldnames or ())]
    if missing:
        raise StepError(f"plan {source}: column {missing[0]} is missing; give {', '.join(wanted)}")
    twice = [column for column in wanted if (reader.fieldnames or ()).count(column) > 1]
    if twice:
        raise StepError(f"plan {source}: column {twice[0]} stands there twice; keep one")
    steps = [_step(scene, row, f"plan {source}, line {reader.line_num}") for row in reader]
    for expected, step in enumerate(steps, start=1):
        if step.number != expected:
            raise StepError(
                f"plan {source}: step {step.number} stands where {expected} should; number from 1"
            )
    return check_sequence(scene, steps)


def _step(scene: Scene, row: Row, where: str) -> Step:
    kinds = {kind.value: kind for kind in StepKind}
    if row["type"] not in kinds:
        raise StepError(f"{where}: type is {short(row['type'])}; give one of {', '.join(kinds)}")
    return Step(
        number=_integer(row, "step", where),
        kind=kinds[row["type"]],
        bricks=_integer(row, "bricks", where),
        grips=tuple(_grip(scene, robot, row, where) for robot in scene.robots),
    )


def _grip(scene: Scene, robot: Robot, row: Row, where: str) -> int | None:
    """Return the node a robot holds; its brick, if named, must be the node's."""
    if not row[f"{robot.name}_node"].strip():
        return None
    node = _integer(row, f"{robot.name}_node", where)
    if row.get(f"{robot.name}_brick", "").strip() and node in scene.brick_of_node:
        named = _integer(row, f"{robot.name}_brick", where)
        actual = scene.brick_of_node[node].name
        if named != actual:
            raise StepError(
                f"{where}: {robot.name} holds node {node} of brick {named}; it is on brick {actual}"
            )
    return node


def _integer(row: Row, column: str, where: str) -> int:
    try:
        return whole(column, int(row[column]))
    except ValueError as error:
        text = short(row[column])
        raise StepError(f"{where}: {column} is {text}; give a whole number") from error
