"""Where the bases of arms should stand: the best plan that any of some places allow.

Three bounds on the plans of a set of bases are asked before it is computed which arms are in each
other's way: that of robots without arms, which holds for all sets; that no brick lacks a robot that
reaches it; and the best plan of the same arms if none were in another's way. Each of these plans
is proven, so what they skip cannot be better. Where joints of arms give way, robots without arms
and arms in other postures hold otherwise, and the second bound alone is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from math import inf

import numpy as np
import pandas as pd

from seqopt.arms._permits import permits
from seqopt.arms.reach import find_postures
from seqopt.arrays import Terse, Vector
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, SceneError
from seqopt.plan._range import best_of_several
from seqopt.plan._studies._tried import Tried, bound_of, is_below
from seqopt.plan.plan import Plan
from seqopt.plan.solving import _moved
from seqopt.problem.problem import Problem
from seqopt.scene._armed import within_reach
from seqopt.scene.arm import Arm
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell

_ROUND, _NEAR, _FAR = 0.35, 0.25, 0.7  # of the reach: spacing, and distances from the bricks
_MOST = 5_000  # sets of bases


def _said(place: Vector) -> str:
    return ", ".join(f"{p:.3g}" for p in place)


@dataclass(frozen=True)
class Base:
    """A place for the base of an arm: where it stands, m, and the directions of its x and y."""

    position: Vector
    x_axis: Vector
    y_axis: Vector

    def __str__(self) -> str:
        return f"({_said(self.position)})"


@dataclass(frozen=True, repr=False)
class FoundBases(Terse):
    """The best plan of all sets of bases, and what became of each set.

    ``problem``: with the bases of the plan; ``tried``: a row for every set, in the order in which
    they were looked at: the base of every robot, ``outcome`` and by goal what is known; ``proven``:
    whether no set that was given allows a better plan.
    """

    plan: Plan
    problem: Problem
    tried: pd.DataFrame
    proven: bool

    @property
    def said(self) -> str:
        """What was chosen, and of how many sets, in words."""
        arms = ((robot.name, robot.arm) for robot in self.problem.scene.robots)
        at = [f"{n} at ({_said(arm.position)})" for n, arm in arms if arm is not None]
        outcomes = self.tried["outcome"]
        solved, skipped = ((outcomes.str.startswith(w)).sum() for w in ("solved", "skipped"))
        rest = len(outcomes) - solved - skipped
        end = "no set allows a better plan" if self.proven else "another may allow a better plan"
        counts = f"{solved} solved, {skipped} skipped by a bound, {rest} without a plan"
        return f"bases: {', '.join(at)}; {len(outcomes)} sets: {counts}; {end}"


def facing(scene: Scene, position: Vector) -> Base:
    """Return a base that stands upright and whose x points to the middle of the bricks."""
    up, at = np.array(scene.up), np.array(position)
    middle = np.mean([brick.position for brick in scene.bricks], axis=0)
    x = middle - at - up * (up @ (middle - at))
    size = float(np.linalg.norm(x))
    x = x / size if size > 0 else level_axis(up)
    y = np.cross(up, x)
    return Base(position, _vector(x), _vector(y))


def level_axis(up: np.ndarray) -> np.ndarray:
    """Return a unit vector at right angles to one that points up: x where that is z."""
    least = np.eye(3)[int(np.argmin(np.abs(up)))]
    x = least - up * (up @ least)
    return np.asarray(x / np.linalg.norm(x))


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def grid(scene: Scene, spacing: float | None = None) -> dict[str, tuple[Base, ...]]:
    """Return places around the bricks for every robot with an arm, at the height of its base.

    They stand on a square grid from a quarter of the arm's reach from the nearest brick, seen from
    above, to seven tenths, and look to the middle of the bricks. ``spacing``: of the grid, m; by
    default 0.35 of the reach.
    """
    return {
        robot.name: tuple(_places(scene, robot.arm, spacing))
        for robot in scene.robots
        if robot.arm is not None
    }


def _places(scene: Scene, arm: Arm, spacing: float | None) -> Iterator[Base]:
    from seqopt.arms._model import ArmModel  # noqa: PLC0415  # an extra

    up, reach = np.array(scene.up), ArmModel(arm).reach
    step = spacing or _ROUND * reach
    x = level_axis(up)
    plane = np.array([x, np.cross(up, x)])
    bricks = np.array([brick.position for brick in scene.bricks])
    flat = bricks @ plane.T
    height = float(np.array(arm.position) @ up)
    low, high = flat.min(axis=0) - _FAR * reach, flat.max(axis=0) + _FAR * reach
    middle = 0.5 * (low + high)
    counts = np.floor(0.5 * (high - low) / step).astype(int)
    for i, j in product(*(range(-count, count + 1) for count in counts.tolist())):
        at = middle + step * np.array([i, j])
        away = float(np.linalg.norm(flat - at, axis=1).min())
        if _NEAR * reach <= away <= _FAR * reach:
            yield facing(scene, _vector(at @ plane + height * up))


def without_arms(scene: Scene) -> Scene:
    """Return a scene whose robots have no arms, and reach what they reach without."""
    return _with_arms(scene, lambda _: None)


def choose_bases(
    problem: Problem,
    scene: Scene,
    places: Mapping[str, Sequence[Base]],
    solved: Callable[[Problem], Plan],
    tell: Tell = lambda _: None,
) -> FoundBases:
    """Return the best plan of a free schedule over all sets of bases.

    ``problem``: of robots without arms; ``scene``: with arms, at any bases; ``places``: by robot;
    others stay where they are; ``solved``: returns the proven plan of a problem. Raises
    `InfeasibleError` if no set allows a plan; `NothingFoundError` if that is open; `ProblemError`
    if there are too many sets.
    """
    sets = [*_sets(scene, places)]
    if len(sets) > _MOST:
        raise ProblemError(
            f"bases: {len(sets)} sets of bases, and up to {_MOST} are looked at; give fewer places"
        )
    standing = [(s, _standing(scene, s)) for s in sets]
    return best_of_several(problem, lambda asked: _Search(asked, solved, tell).found(standing))


def _sets(scene: Scene, places: Mapping[str, Sequence[Base]]) -> Iterator[dict[str, Base]]:
    """Yield all sets of bases, one for every robot that has places; none of them twice.

    Robots that differ in nothing but name and base could change places: their bases rise.
    """
    names = [*places]
    alike = {name: _kind(next(r for r in scene.robots if r.name == name)) for name in names}
    for rows in product(*(range(len(places[name])) for name in names)):
        found = {name: places[name][i] for name, i in zip(names, rows, strict=True)}
        if len({base.position for base in found.values()}) < len(found):
            continue
        pairs = zip(names, rows, strict=True)
        kinds: dict[object, list[int]] = {}
        for name, i in pairs:
            kinds.setdefault((alike[name], tuple(places[name])), []).append(i)
        if all(own == sorted(own) for own in kinds.values()):
            yield found


def _kind(robot: Robot) -> object:
    """Return what counts of a robot beside its name and base."""
    assert robot.arm is not None
    x, y, nowhere = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
    arm = replace(robot.arm, position=nowhere, x_axis=x, y_axis=y)
    return replace(robot, name="any", arm=arm)


def _standing(scene: Scene, bases: Mapping[str, Base]) -> Scene:
    """Return a scene with arms at some bases."""

    def at(robot: Robot) -> Robot:
        base = bases.get(robot.name)
        if base is None or robot.arm is None:
            return robot
        x, y = base.x_axis, base.y_axis
        arm = replace(robot.arm, position=base.position, x_axis=x, y_axis=y)
        return replace(robot, arm=arm)

    return scene.with_robots(*map(at, scene.robots))


def _with_arms(scene: Scene, change: Callable[[Arm], Arm | None]) -> Scene:
    pairs = ((robot, robot.arm) for robot in scene.robots)
    return scene.with_robots(
        *(r if arm is None else replace(r, arm=change(arm)) for r, arm in pairs)
    )


class _Search(Tried):
    """Looks at sets of bases, the most promising first, and keeps the best plan so far."""

    _why = ""

    def found(self, sets: Sequence[tuple[dict[str, Base], Scene]]) -> FoundBases:
        """Return the best plan of sets of bases."""
        soft = any(scene.grip_kinds.arms.any() for _, scene in sets)
        floor = (-inf,) if soft else bound_of(self._solved(self._problem))  # of robots without arms
        for number, (_, bases, scene) in enumerate(self._by_promise(sets), start=1):
            self._tell(f"bases, set {number} of {len(sets)}")
            if self._plan is not None and not is_below(floor, self._best):
                outcome, bound = "skipped: no robots do better", floor
            else:
                found = self._in_time(partial(self._outcome, scene))
                if found is None:
                    break
                outcome, bound = found
            said = {name: str(base) for name, base in bases.items()}
            self._rows.append({**said, "outcome": outcome, **self._named(bound)})
            if self._over:
                break
        if self._plan is None or self._of is None:
            raise self._none(
                f"bases: none of {len(sets)} sets of bases allows a plan: {self._why}; give other "
                "places"
            )
        return FoundBases(self._plan, self._of, pd.DataFrame(self._rows), self._proven)

    def _without(self, why: str) -> tuple[str, tuple[float, ...]]:
        """Return what is known of a set without a plan; of the most promising one it is kept."""
        self._why = self._why or why
        return f"no plan: {why}", (inf,)

    def _by_promise(
        self, sets: Sequence[tuple[dict[str, Base], Scene]]
    ) -> list[tuple[float, dict[str, Base], Scene]]:
        """Return sets by how much of the build their arms reach by themselves, the most first."""
        ranked: list[tuple[float, dict[str, Base], Scene]] = []
        for bases, scene in sets:
            ranked.append((-self._covered(scene), bases, scene))
        return sorted(ranked, key=lambda each: each[0])

    def _covered(self, scene: Scene) -> float:
        """Return the share of robots, nodes and brick counts with a posture; -1 if it is none."""
        apart = _with_arms(scene, lambda arm: replace(arm, keeps_apart=False, joint_stiffness=()))
        try:
            found = permits(apart)
        except SceneError:  # a base stands in a brick
            return -1.0
        return float(np.minimum(found.until[:, 1:], len(scene.bricks) + 1).mean())

    def _outcome(self, scene: Scene) -> tuple[str, tuple[float, ...]]:
        """Return the outcome of a set of bases in words, and lower bounds of its plans."""
        apart = _with_arms(scene, lambda arm: replace(arm, keeps_apart=False, joint_stiffness=()))
        soft = scene.grip_kinds.arms.any()
        try:
            lacking = _lacking(apart)
            if lacking is not None:
                return self._without(f"nobody reaches brick {lacking}")
            alone = (-inf,) if soft else bound_of(self._solved(_moved(self._problem, apart)))
            if self._plan is not None and not is_below(alone, self._best):
                return "skipped: by reach alone no better", alone
            find_postures(scene, self._problem.resources.cache, self._tell)
            problem = _moved(self._problem, scene)
            plan = self._solved(problem)
        except NothingFoundError as error:
            return self._open(error)
        except (InfeasibleError, SceneError) as error:
            return self._without(str(error))
        if plan.arms is not None and plan.arms.postures.unreached:
            self._left.append(bound := bound_of(plan))
            return "no plan that keeps postures was found", bound
        return self._kept(problem, plan)


def _lacking(scene: Scene) -> int | None:
    """Return a brick that no robot reaches when it is placed; None if there is none."""
    reached = [within_reach(scene, robot) for robot in scene.robots]
    for k, brick in enumerate(scene.placed):
        if not any(nodes[k] for nodes in reached):
            return brick.name
    return None
