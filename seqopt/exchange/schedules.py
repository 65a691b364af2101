"""Files of schedules and plans: tables of steps, some grips of which may be open."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from seqopt._files import read_text
from seqopt.errors import StepError
from seqopt.exchange._files import Row, harmless, read_table
from seqopt.network.network import Network, network_of
from seqopt.scene._checks import short, whole
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import open_schedule
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule, ScheduledGrips
from seqopt.sequence.steps import Step, StepKind, _check_state, _check_step


def read_plan(scene: Scene, path: Path) -> tuple[Step, ...]:
    r"""Return the checked steps of a plan file.

    Parameters
    ----------
    scene : Scene
        The scene in which every step must be possible.
    path : pathlib.Path
        The CSV file, or the folder of a plan; see `parse_plan` for the columns.

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
    file = Path(path) / "plan.csv" if Path(path).is_dir() else Path(path)
    return parse_plan(scene, read_text(file), str(file))


def _read_listed(scene: Scene, path: Path) -> tuple[Step, ...]:
    """Return the steps of a plan; robots of the scene that it does not list hold nothing."""
    file = Path(path) / "plan.csv" if Path(path).is_dir() else Path(path)
    columns = read_text(file).partition("\n")[0].split(",")
    known = [robot for robot in scene.robots if f"{robot.name}_node" in columns]
    steps = read_plan(scene.with_robots(*known) if known else scene, file)
    if not known:
        return steps
    where = [known.index(robot) if robot in known else None for robot in scene.robots]
    listed = (tuple(None if k is None else s.grips[k] for k in where) for s in steps)
    return tuple(replace(s, grips=grips) for s, grips in zip(steps, listed, strict=True))


def parse_plan(scene: Scene, text: str, source: str) -> tuple[Step, ...]:
    """Return the checked steps of a plan, numbered from 1, or of a part of one, numbered on.

    The text is CSV with the columns ``step``, ``type``, ``bricks`` and, for every robot,
    ``NAME_node``; an empty cell means that the robot does not grip.
    Other columns are ignored. A take-down may begin with any bricks.
    """
    what, out = f"plan {source}", list[Step]()
    for where, step in _read_steps(scene, text, what, part=True):
        if step.moves:
            raise StepError(
                f"{where}: a grip is ?, open; give its node, or optimize the file as a schedule"
            )
        nodes = (grip if isinstance(grip, int) else None for grip in step.grips)
        out.append(Step(step.number, step.kind, step.bricks, tuple(nodes)))
    return tuple(out)


def _read_steps(
    scene: Scene, text: str, what: str, *, part: bool = False
) -> list[tuple[str, OpenStep]]:
    """Return the steps of a table, each with the line that it is in, after `_check_rows`."""
    wanted = ["step", "type", "bricks", *(f"{robot.name}_node" for robot in scene.robots)]
    columns, rows = read_table(text, what, StepError)
    if lacking := [column for column in wanted if column not in columns]:
        scene_too = ", or the scene that it is for" if lacking[0].endswith("_node") else ""
        give = ", ".join(wanted) + scene_too
        raise StepError(f"{what}: column {lacking[0]} is missing; give {give}")
    if twice := [column for column in wanted if columns.count(column) > 1]:
        raise StepError(f"{what}: column {twice[0]} occurs twice; keep one")
    known = (*wanted, "prop_node")  # of a plan with props
    if unknown := [name for name in columns if name.endswith("_node") and name not in known]:
        raise StepError(
            f"{what}: column {unknown[0]}: no robot of scene {scene.name} is called so; "
            f"give {', '.join(wanted[3:])}"
        )
    if not rows:
        raise StepError(f"{what}: it has no steps; give at least one")
    kinds, out = {kind.value: kind for kind in StepKind}, list[tuple[str, OpenStep]]()
    grips: ScheduledGrips = (None,) * len(scene.robots)
    opened = 0
    for line, row in rows:
        where = f"{what}, line {line}"
        if None in row:
            raise StepError(
                f"{where}: it has more cells than there are columns; leave out the rest"
            )
        if (kind := row["type"]) not in kinds:
            raise StepError(f"{where}: type is {short(kind)}; give one of {', '.join(kinds)}")
        number, bricks = (_integer(row[name], f"{where}: {name}") for name in ("step", "bricks"))
        now: list[int | OpenGrip | None] = []
        for robot, held in zip(scene.robots, grips, strict=True):
            now.append(_read_grip(robot, row, where, held, opened))
            opened += isinstance(now[-1], OpenGrip) and now[-1] != held
        grips = tuple(now)
        out.append((where, OpenStep(number, kinds[kind], bricks, grips)))
    _check_rows(scene, out, part=part)
    return out


def _check_rows(scene: Scene, rows: Sequence[tuple[str, OpenStep]], *, part: bool) -> None:
    """Require steps that are numbered, and feasible one after the other.

    ``part``: whether the first may go on from any state: a build does so where it is numbered on,
    a take-down always.
    """
    first, before = rows[0][1], None
    begins = (first.kind, first.bricks) == (StepKind.PLACE, 1)
    goes_on = part and not begins
    goes_on &= first.number > 1 or any(step.kind is StepKind.REMOVE for _, step in rows)
    for number, (where, step) in enumerate(rows, start=max(first.number, 1) if goes_on else 1):
        if step.number != number:
            wanted = f"should be {number}; number steps from 1"
            raise StepError(f"{where}: step {step.number} {wanted}")
        try:
            if before is None and goes_on:
                _check_state(scene, step, f"step {number}")
            else:
                _check_step(scene, before, step)
        except StepError as error:
            raise StepError(f"{where}: {error}") from error
        before = step


def _read_grip(
    robot: Robot, row: Row, where: str, held: object, opened: int
) -> int | OpenGrip | None:
    """Return a robot's grip; a mark continues the open grip that it held, or is a new move.

    ``opened``: moves so far.
    """
    column = f"{robot.name}_node"
    cell = row[column].strip()
    if not cell:
        return None
    if (mark := _MARK.fullmatch(cell)) is not None:
        grip = held if isinstance(held, OpenGrip) else OpenGrip(opened)
        if mark[1] and int(mark[1]) != grip.move + 1:
            raise StepError(
                f"{where}: {column} is {cell!r}, but this is open grip {grip}: open grips are "
                f"numbered as they are taken, and last until the robot lets go; give {grip}, or "
                f"let {robot.name} release first"
            )
        return grip
    return _integer(cell, f"{where}: {column}", "a node, ? for an open grip, or nothing")


def _integer(cell: str, where: str, wanted: str = "a whole number") -> int:
    """Parse an integer; also 48.0, as tables with empty cells are often written."""
    text = cell.strip()
    try:
        return whole(where, int(text.removesuffix(".0")))
    except ValueError as error:
        raise StepError(f"{where} is {short(text)}; give {wanted}") from error


_MARK = re.compile(r"\?\s*(\d*)")  # an open grip, and the number of its move if it is given


def read_schedule(where: Network | Scene, path: Path) -> Schedule:
    r"""Return the checked schedule of a file.

    Parameters
    ----------
    where : Network or Scene
        The network or scene in which every step must be possible.
    path : pathlib.Path
        The CSV file; see `parse_schedule` for its columns.

    Returns
    -------
    Schedule
        The schedule, named after the file without its suffix.

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
    >>> text = "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n2,place,2,1,?,\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "mine.csv"
    ...     _ = path.write_text(text)
    ...     schedule = seqopt.read_schedule(seqopt.load_scene("arch25"), path)
    >>> schedule.method, schedule.moves[0].robot, schedule.moves[0].candidates
    ('mine', 'rob2', (2,))
    """
    return parse_schedule(where, read_text(path), str(path))


def parse_schedule(where: Network | Scene, text: str, source: str) -> Schedule:
    """Return the checked schedule of a table, named after the last part of its source.

    The text is CSV with the columns of a plan (`parse_plan`). A cell of a robot is empty where it
    does not grip, the number of a node where this is given, and ``?`` where the grip is open; in
    the rows that follow, ``?`` is the same grip, until the robot lets go. Open grips may carry the
    number of their move, ``?1``, ``?2``, in the order in which they are taken; it must be right.
    """
    network = network_of(where)
    scene, what = network.scene, f"schedule {source}"
    steps = [step for _, step in _read_steps(scene, text, what)]
    try:
        return open_schedule(Path(source).stem, network, steps)
    except StepError as error:
        raise StepError(f"{what}: {error}") from error


def schedule_text(schedule: Schedule) -> str:
    """Return a schedule as the table that `parse_schedule` reads, its open grips numbered from 1.

    Examples
    --------
    >>> import seqopt
    >>> schedule = seqopt.three_robot_loop(seqopt.build_network(seqopt.load_scene("arch25")))
    >>> print(*schedule_text(schedule).splitlines()[:4], sep=chr(10))
    step,type,bricks,rob1_node,rob2_node,rob3_node
    1,place,1,1,,
    2,place,2,1,2,
    3,place,3,1,2,?1
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [f"{robot.name}_node" for robot in schedule.scene.robots]
    writer.writerow(["step", "type", "bricks", *map(harmless, names)])
    writer.writerows([s.number, s.kind.value, s.bricks, *s.grips] for s in schedule.steps)
    return out.getvalue()
