"""Timetables of builds, and the same grips by other robots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from seqopt.errors import StepError
from seqopt.plan.build import ShownBuild
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene, can_carry
from seqopt.sequence.schedule import Hold, carried
from seqopt.sequence.steps import Site, Step, idle_robots
from seqopt.times._curing import Waits
from seqopt.times._steps import reassigned_steps, step_times


def times_table(
    scene: Scene, steps: Sequence[Step], waits: Waits | None = None, begin: Site | None = None
) -> pd.DataFrame:
    """Return the earliest timetable: a row per step, as of `Plan.times`.

    ``waits``: as of `step_times`, where mortar cures; ``begin``: where a part of a build begins.

    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> scene = scene.with_durations("fetch=30,place=10,approach=10,grip=5,release=5")
    >>> table = times_table(scene, seqopt.sequential(seqopt.build_network(scene)))
    >>> table[["step", "robots", "start_s", "end_s"]].head(3).values.tolist()
    [[1, 'rob1', 30.0, 40.0], [2, 'rob2', 40.0, 50.0], [3, 'rob1', 50.0, 55.0]]
    """
    rows, end = [], 0.0
    for step, time in zip(steps, step_times(scene, steps, waits, begin), strict=True):
        taken = [step.grips[r] for r in time.robots if step.grips[r] is not None]
        ready = end if time.ready is None else max(end, time.ready)
        cures = {"cures_s": max(0.0, time.start - ready), "joint": time.joint}  # wait for mortar
        rows.append(
            {
                "step": step.number,
                "type": step.kind.value,
                "bricks": step.bricks,
                "robots": ";".join(scene.robots[r].name for r in time.robots),
                "node": taken[0] if taken else None,
                "prepares_s": time.prepares,
                "ready_s": time.ready,
                "start_s": time.start,
                "end_s": time.end,
                "waits_s": time.start - end,
                **({} if waits is None else cures),
            }
        )
        end = time.end
    return pd.DataFrame(rows).astype({"node": "Int64", "prepares_s": float, "ready_s": float})


def busy_table(scene: Scene, steps: Sequence[Step], waits: Waits | None = None) -> pd.DataFrame:
    """Return how long each robot ``prepares_s``, ``acts_s``, ``holds_s`` and is ``idle_s``."""
    times = step_times(scene, steps, waits)
    out = {
        robot.name: dict.fromkeys(("prepares_s", "acts_s", "holds_s"), 0.0)
        for robot in scene.robots
    }
    before: Sequence[int | None] = (None,) * len(scene.robots)
    end = 0.0
    for step, time in zip(steps, times, strict=True):
        for r, robot in enumerate(scene.robots):
            own = out[robot.name]
            if r in time.robots:
                own["acts_s"] += time.end - time.start
                if step.grips[r] is None:
                    own["holds_s"] += time.start - end
                elif time.ready is not None and time.prepares is not None:
                    own["prepares_s"] += time.ready - time.prepares
            elif before[r] is not None:
                own["holds_s"] += time.end - end
        before, end = step.grips, time.end
    table = pd.DataFrame.from_dict(out, orient="index").rename_axis("robot")
    table["idle_s"] = end - table.sum(axis=1)
    return table.reset_index()


def busy_said(busy: pd.DataFrame) -> Iterator[str]:
    """Yield how each robot spends its time, from `busy_table`, in words."""
    for row in busy.to_dict("records"):
        named = ("prepares", "acts", "holds", "idle")
        spent = (f"{what} {row[f'{what}_s']:.6g} s" for what in named)
        yield f"  {row['robot']}: {', '.join(spent)}"


def reassign(
    scene: Scene,
    steps: Sequence[Step],
    responses: pd.DataFrame,
    waits: Waits | None = None,
    begin: Site | None = None,
) -> tuple[Step, ...]:
    """Return the same grips in the same order by robots with which the build takes least.

    ``responses``: of the steps, as of `seqopt.analyze`. A robot may have a grip if it reaches the
    node, has the same compliance there, and carries the largest force of the grip, and the
    brick that it places or takes away, within its payload; who carried more before may go on. Where
    mortar cures (``waits``, ``begin``: as of `step_times`) its payload is no less than that of the
    one who had it. A `StepError` says that robots have arms.
    """
    if scene.has_arms:
        raise StepError(
            f"scene {scene.name}: arms keep postures while they hold; robots cannot be reassigned"
        )
    forces = {
        r: responses[force_column(robot)].abs().to_numpy(float)
        for r, robot in enumerate(scene.robots)
    }
    kinds = scene.grip_kinds.compliance[scene.grip_kinds.of_robot]
    turns = scene.grip_kinds.turns[scene.grip_kinds.of_robot]
    bricks = {(each.robot, each.step): each.brick for each in carried(scene, steps)}
    able = [can_carry((scene,), robot) for robot in range(len(scene.robots))]

    def may(robot: int, hold: Hold) -> bool:
        had = hold.robot
        if robot == had:
            return True
        assert hold.node is not None  # steps of a plan have no open grips
        position = scene.node_position(hold.node)
        shown = forces[had][max(0, hold.first - steps[0].number) : hold.last + 1 - steps[0].number]
        force = float(shown.max(initial=0.0))
        most = scene.robots[robot].payload * (1 + LIMIT_TOLERANCE)
        if waits is not None and scene.robots[robot].payload < scene.robots[had].payload:
            return False
        alike = bool((kinds[robot] == kinds[had]).all() and turns[robot] == turns[had])
        both = (bricks.get((had, number)) for number in (hold.first, hold.last + 1))
        alike &= all(able[robot][scene.since[brick] - 1] for brick in both if brick is not None)
        return alike and force <= most and scene.robots[robot].reach.covers(position)

    idle, every = idle_robots(scene, steps), enumerate(scene.robots)
    known = [r for r, robot in every if robot.durations is not None or robot.name not in idle]
    return reassigned_steps(scene, steps, may, known, waits, begin)


def waits_said(build: ShownBuild) -> Iterator[str]:
    """Yield the total wait for mortar of a judged build."""
    if build.standing is None or build.standing.curing is None:
        return
    table = build.times()
    waits = table[table["cures_s"] > 0]
    steps, total = f"{len(waits)} step{'s' * (len(waits) > 1)}", waits["cures_s"].sum()
    text = f"{total:.6g} s are waits for mortar, in {steps}"
    yield text if len(waits) else "no step waits for mortar"
    yield "every state is proven to stand with the bond that its joints have when it begins"
