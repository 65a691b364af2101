"""State of a site: placed bricks and grips, at which builds may begin and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

from seqopt.errors import StepError
from seqopt.scene._checks import finite, settle, short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind, _check_state


@dataclass(frozen=True)
class Site:
    """State of a site.

    Parameters
    ----------
    bricks : int
        How many bricks stand, in build order.
    grips : tuple of (int or None), optional
        Node that each of the scene's robots holds. By default nobody holds anything where a build
        begins; where it ends, the rule ``ending`` says who holds.
    stays : tuple of (int or None), optional
        Node that each robot that is free held last, from which its travel counts.
    regrips : int
        How many grips were taken since the last brick, besides that which placed it.
    step : int, optional
        Number of the step that led there: steps are numbered on from it. By default 1, and 0 for
        the empty site.
    ages : tuple of float, optional
        For how long bricks, in build order, have been in their places, s, where mortar cures; by
        default they were placed just now.

    Examples
    --------
    >>> import seqopt
    >>> steps = seqopt.sequential(seqopt.build_network(seqopt.load_scene("arch25")))
    >>> Site.after(steps, 4)
    Site(bricks=3, grips=(4, 2, None), stays=(None, None, None), regrips=0, step=4, ages=())
    """

    bricks: int
    grips: Grips | None = None
    stays: Grips = ()
    regrips: int = 0
    step: int = -1
    ages: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        ages = tuple(finite("site: age", age, 0.0) for age in self.ages)
        if len(ages) > max(self.bricks, 0):
            raise StepError(f"site: {len(ages)} ages of {self.bricks} bricks; give one for each")
        settle(self, ages=ages, step=self.step if self.step >= 0 else int(self.bricks != 0))

    @classmethod
    def after(cls, steps: Sequence[Step], count: int) -> Site:
        """Return the site after a number of steps of a build, 0 for the empty site."""
        first, last = (steps[0].number - 1, steps[-1].number) if steps else (0, 0)
        if not isinstance(count, Integral) or not (first or 0) <= count <= last:
            raise StepError(f"step {short(count)}: the plan has {first} to {last}")
        done = steps[: count - first]
        if first and not done:
            raise StepError(f"step {count}: the plan begins after it; give {first + 1} to {last}")
        lasts: dict[int, int] = {r: n for s in done for r, n in enumerate(s.grips) if n is not None}
        regrips = 0
        for step in done:
            regrips = 0 if step.kind in (StepKind.PLACE, StepKind.REMOVE) else regrips
            regrips += step.kind is StepKind.REPOSITION
        if not done and any(step.kind is StepKind.REMOVE for step in steps):
            bricks = steps[0].bricks + (steps[0].kind is StepKind.REMOVE)
            return cls(bricks, (None,) * len(steps[0].grips), step=0)
        if not done:
            return cls(0)
        free = (lasts.get(r) if node is None else None for r, node in enumerate(done[-1].grips))
        return cls(done[-1].bricks, done[-1].grips, tuple(free), regrips, done[-1].number)

    @property
    def placed(self) -> list[float]:
        """When the placed bricks were in position, s, from their ages."""
        return [-age for age in self.ages] + [0.0] * (self.bricks - len(self.ages))

    @property
    def held(self) -> int:
        """Number of grips."""
        return sum(node is not None for node in self.grips or ())

    def holds(self, scene: Scene) -> Grips:
        """Return the node that each robot holds; raise an error if the scene does not allow it."""
        grips, most = self.grips, len(scene.placed)
        if not isinstance(self.bricks, Integral) or not 0 <= self.bricks <= most:
            raise StepError(
                f"site: {short(self.bricks)} bricks; scene {scene.name} has 0 to {most}"
            )
        if grips is None:
            return (None,) * len(scene.robots)
        if self.bricks:
            _check_state(scene, Step(0, StepKind.RELEASE, self.bricks, tuple(grips)), "site")
        elif self.held:
            raise StepError("site: a robot holds a brick, and none stands; give bricks")
        for prop in scene.props:
            if prop.node in grips:
                raise StepError(f"site: a robot holds node {prop.node} of a prop; leave one out")
        return grips

    def described(self, scene: Scene) -> dict[str, object]:
        """Return bricks and grips by names, ready for JSON."""
        pairs = zip(scene.robots, self.holds(scene), strict=True)
        held = {robot.name: node for robot, node in pairs if node is not None}
        return {
            "bricks": [brick.name for brick in scene.placed[: self.bricks]],
            "grips": held if self.grips is not None else "as the rule ending says",
        }


def _begin_step(scene: Scene, site: Site | None) -> Step:
    """Return the state before the first step of a build, as the step that led to it."""
    if site is None:
        return Step(0, StepKind.RELEASE, 0, (None,) * len(scene.robots))
    return Step(site.step, StepKind.RELEASE, site.bricks, site.holds(scene))
