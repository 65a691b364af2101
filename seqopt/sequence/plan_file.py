"""Plan files: sequences of steps as CSV, with the first columns of the paper's Table A.1."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from seqopt.errors import StepError
from seqopt.files import plain, read_text
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
        The scene in which every step must be possible.
    path : pathlib.Path
        The CSV file; see `parse_plan` for its columns.

    Returns
    -------
    tuple of Step
        Numbered from 1.

    Raises
    ------
    FileError
        If the file cannot be read.
    StepError
        If the file is not such a table, or a step is impossible.

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

    ``scene``: in which every step must be possible. ``text``: CSV with the columns ``step``,
    ``type``, ``bricks`` and, for every robot, ``NAME_node`` and, if present, ``NAME_brick``; an
    empty cell means that the robot does not grip. Other columns are ignored. Result: numbered from
    1. Raises `StepError` if the text is not such a table or a step is impossible.
    """
    rows = read_rows(scene, text, f"plan {source}")
    steps = [_step(scene, row, f"plan {source}, line {line}") for line, row in rows]
    for expected, step in enumerate(steps, start=1):
        if step.number != expected:
            raise StepError(
                f"plan {source}: step {step.number} should be {expected}; number steps from 1"
            )
    return check_sequence(scene, steps)


def read_rows(scene: Scene, text: str, what: str) -> list[tuple[int, Row]]:
    """Return the rows of a table of steps.

    ``scene``: whose robots have a column each; ``text``: CSV, as in `parse_plan`. Result (int, dict
    of str to str): the number of the line, and its cells by column. Raises `StepError` if a column
    is missing or occurs twice, or the text is not a CSV file.
    """
    try:
        return _rows(scene, csv.DictReader(io.StringIO(text), restval=""), what)
    except csv.Error as error:
        raise StepError(f"{what}: not a readable CSV file: {error}") from error


def _rows(scene: Scene, reader: csv.DictReader[str], what: str) -> list[tuple[int, Row]]:
    reader.fieldnames = [plain(name or "") for name in reader.fieldnames or ()]
    wanted = ["step", "type", "bricks", *(f"{robot.name}_node" for robot in scene.robots)]
    missing = [column for column in wanted if column not in (reader.fieldnames or ())]
    if missing:
        raise StepError(f"{what}: column {missing[0]} is missing; give {', '.join(wanted)}")
    twice = [column for column in wanted if (reader.fieldnames or ()).count(column) > 1]
    if twice:
        raise StepError(f"{what}: column {twice[0]} occurs twice; keep one")
    return [(reader.line_num, row) for row in reader]


def _step(scene: Scene, row: Row, where: str) -> Step:
    number, kind, bricks = read_cells(row, where)
    grips = tuple(read_grip(scene, robot, row, where) for robot in scene.robots)
    return Step(number, kind, bricks, grips)


def read_cells(row: Row, where: str) -> tuple[int, StepKind, int]:
    """Return what a row says beside its grips.

    ``row``: cells by column. Raises `StepError` if a cell is not a whole number, or there is no
    such type.
    """
    kinds = {kind.value: kind for kind in StepKind}
    if row["type"] not in kinds:
        raise StepError(f"{where}: type is {short(row['type'])}; give one of {', '.join(kinds)}")
    number, bricks = _integer(row, "step", where), _integer(row, "bricks", where)
    return number, kinds[row["type"]], bricks


def read_grip(scene: Scene, robot: Robot, row: Row, where: str) -> int | None:
    """Return the node a robot holds; its brick, if named, must be the node's.

    ``row``: cells by column. Raises `StepError` if a cell is not a whole number, or the node is on
    another brick.
    """
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
    """Return a whole number; 48.0, as tables with empty cells are often written, is one too."""
    text = row[column].strip()
    try:
        return whole(column, int(text.removesuffix(".0")))
    except ValueError as error:
        raise StepError(f"{where}: {column} is {short(text)}; give a whole number") from error
