"""Arches by span and rise, and of any number of bricks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import (
    check,
    density,
    length,
    letters,
    one_of,
    positive,
    sizes,
    whole_between,
)
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.boxes import require_apart
from seqopt.scene.library.common import MASONRY, JointLaw, _few_enough, _joint_width, a_law
from seqopt.scene.parts import THICKEST
from seqopt.scene.scene import Scene

optimize = Later("scipy.optimize")  # slow to import
_EXACT = 1e-15  # of what is sought along a curve

_Line = Callable[[float], Floats]
"""Takes a number from 0 at the first springing to 1 at the second; returns (x, z), m."""


def _circular(span: float, rise: float) -> _Line:
    """Return the arc of a circle, at most half of one, through both springings and the crown."""
    if rise > 0.5 * span * (1 + 1e-12):
        raise SceneError(
            f"arch: rise is {rise:g} m; a circular arch rises at most half of its span, "
            f"{0.5 * span:g}: give less, or the curve catenary"
        )
    radius = (0.25 * span**2 + rise**2) / (2 * rise)
    half = 2 * math.atan(2 * rise / span)

    def line(at: float) -> Floats:
        turn = half * (2 * at - 1)
        x, drop = radius * math.sin(turn), radius * (1 - math.cos(turn))
        return np.array([0.5 * span + x, rise - drop])

    return line


def _catenary(span: float, rise: float) -> _Line:
    """Return a hanging chain turned upside down: the line of thrust of an even arch."""
    # with u = span / 2a: rise / span = (cosh u - 1) / 2u
    slope = optimize.brentq(lambda u: (math.cosh(u) - 1) / (2 * u) - rise / span, 1e-9, 100.0)
    scale, end = 0.5 * span / slope, math.sinh(slope)

    def line(at: float) -> Floats:
        x = scale * math.asinh(end * (2 * at - 1))  # evenly along the line
        return np.array([0.5 * span + x, rise - scale * (math.cosh(x / scale) - 1)])

    return line


_CURVES = {"circular": _circular, "catenary": _catenary}
"""By name; each takes span and rise, m."""


def _chords(line: _Line, lengths: Floats) -> Floats | None:
    """Return the points (n + 1, 2) of a chain of links laid along a line; none if it is short."""
    at, points = 0.0, [line(0.0)]
    for link in lengths.tolist():
        here = points[-1]
        if math.dist(line(1.0), here) < link:
            return None
        at = optimize.brentq(
            lambda s, here=here, link=link: math.dist(line(s), here) - link, at, 1.0, xtol=_EXACT
        )
        points.append(line(at))
    return np.array(points)


_TRIED = 8  # numbers of bricks, where none is given


@dataclass(frozen=True, kw_only=True)
class ArchForm:
    """The numbers that shape an arch; lengths in m.

    The joints lie on the curve, the first and the last at its springings, which are level. They are
    as wide as it takes for the bricks to fill the curve.

    ``span``, ``rise``: between the springings, and from there to the crown; ``curve``:
    ``circular`` or ``catenary``; ``bricks``: by default as many as make the joints
    most nearly as wide as ``gap``; ``pattern``: a letter per brick, repeated: ``V`` lies along the
    arch, ``L`` and ``R`` lie across it and stick out to the left and to the right; ``dimensions``:
    length, width and thickness of a brick; ``gap``: how wide joints are to be where the number of
    bricks is not given; ``density``: kg/m³; ``law``: how stiff joints are.

    Examples
    --------
    >>> ArchForm(span=2.0, rise=0.7).curve
    'circular'
    """

    span: float
    rise: float
    curve: str = "circular"
    bricks: int | None = None
    pattern: str = "V"
    dimensions: Vector = (0.2, 0.1, 0.06)
    gap: float = 0.01
    density: float = 2000.0
    law: JointLaw = MASONRY

    def __post_init__(self) -> None:
        check(self, "arch", span=length, rise=length, curve=partial(one_of, known=_CURVES))
        check(self, "arch", bricks=partial(whole_between, least=2), pattern=letters)
        check(self, "arch", dimensions=sizes, gap=_joint_width, density=density, law=a_law)

    @property
    def line(self) -> _Line:
        """The curve."""
        return _CURVES[self.curve](self.span, self.rise)

    def lengths(self, bricks: int) -> Floats:
        """Return how much of the arch each brick covers, without joints. Result (n,): m."""
        along, across, _ = self.dimensions
        return np.array([along if k == "V" else across for k in (self.pattern * bricks)[:bricks]])


def arch(form: ArchForm) -> Scene:
    """Return the scene of an arch that is built from one springing to the other.

    It stands on both, at z = 0, and runs towards +x in the plane y = 0.

    Two robots stand beside it and one is mobile; each can bear the whole weight. Raises
    `SceneError` if the bricks do not fill the curve, or interpenetrate.

    Examples
    --------
    >>> arch(ArchForm(span=2.0, rise=0.7, bricks=12))
    <Scene circular arch 2 x 0.7: 12 bricks, 11 joints, 2 ground ends, 3 robots>
    """
    long, width, thickness = form.dimensions
    shift, turn = form.law.over_rectangle(width, thickness)

    def build(count: int) -> Scene:
        gap, points = _laid(form, count)
        step = np.diff(points, axis=0)
        shape = ArchShape(
            pitch=np.arctan2(step[:, 1], step[:, 0]).tolist(),
            pattern=form.pattern,
            gap=gap,
            overhang=0.25 * long,  # an inner node of a brick across lies on the line
            stub=0.5 * long,
            translational_stiffness=shift,
            rotational_stiffness=turn,
            dimensions=form.dimensions,
            density=form.density,
        )
        name = f"{form.curve} arch {form.span:g} x {form.rise:g}"
        scene = arch_scene(shape, name, provenance="Generated by seqopt.scene.library.arch_form.")
        remedy = "give another number of bricks, or shorter or thinner ones"
        require_apart(f"arch of {count}", scene.bricks, remedy)
        return scene

    return _first_that_fits(form, build)


def _first_that_fits(form: ArchForm, make: Callable[[int], Scene]) -> Scene:
    """Return the scene of the first number of bricks that can be built.

    If none is given, those first whose joints are most nearly as wide as asked for.
    """
    counts = [form.bricks] if form.bricks else []
    if not counts:
        line = form.line
        points = np.array([line(at) for at in np.linspace(0, 1, 2001)])
        way = float(np.hypot(*np.diff(points, axis=0).T).sum())
        most = math.ceil(2 * way / (form.lengths(len(form.pattern)) + form.gap).min()) + 2
        _few_enough("arch", most // 2)
        over = np.cumsum(form.lengths(most) + form.gap) - way
        off = np.abs(over) / np.arange(1, most + 1)  # what each joint is wider, or narrower
        counts = [int(count) + 2 for count in np.argsort(off[1:], kind="stable")[:_TRIED]]
    refused: SceneError | None = None
    for count in counts:
        try:
            return make(count)
        except SceneError as error:
            refused = refused or error
    raise refused or SceneError("arch: no number of bricks fills its curve; give one")


def _laid(form: ArchForm, count: int) -> tuple[float, Floats]:
    """Return the width of the joints, and the points (n + 1, 2) between bricks that fill a curve.

    The first and the last brick end at a springing, half a joint behind and before.
    """
    lengths, line = form.lengths(count), form.line

    def left(gap: float) -> float:
        points = _chords(line, lengths[:-1] + gap)
        if points is None:
            return -form.span
        return math.dist(points[-1], line(1.0)) - float(lengths[-1]) - gap

    widest = THICKEST * min(form.dimensions)
    if left(0.0) < 0:
        raise SceneError(
            f"arch: {count} bricks, {lengths.sum():.4g} m together, are longer than its curve; "
            "give shorter ones, or fewer"
        )
    if left(widest) > 0:
        raise SceneError(
            f"arch: joints between {count} bricks would be wider than {1e3 * widest:.3g} mm; give "
            "more of them, longer ones, or a smaller gap"
        )
    gap: float = optimize.brentq(left, 0.0, widest, xtol=_EXACT)
    points = _chords(line, lengths[:-1] + gap)
    if points is None:  # by rounding alone
        raise SceneError(f"arch: {count} bricks do not fill its curve; give another number")
    return gap, np.vstack([points, line(1.0)])


_LEAN = 1.4  # rad; 80°: nearly upright
_AT_CORNERS = 0.05  # by which bricks may interpenetrate, over their thickness: as joints allow


def chain(bricks: int, *, lean: float = _LEAN, pattern: str = "VLR") -> Scene:
    """Return the scene of an arch of any number of bricks, built from one end to the other.

    Every brick is turned against the one before by the same angle. Arches of other shapes come from
    `seqopt.scene.arch.arch_scene`.

    ``bricks``: at least two; ``lean``: angle of the first brick above the horizontal and of the
    last one below it, rad; ``pattern``: as in `seqopt.scene.arch.ArchShape`. Raises `SceneError` if
    the bricks are so few that they interpenetrate, or the numbers make no arch.

    Examples
    --------
    >>> chain(100)
    <Scene chain 100: 100 bricks, 99 joints, 2 ground ends, 3 robots>
    """
    count = whole_between("chain: bricks", bricks, 2)
    if positive("chain: lean", lean, "rad") > 0.5 * math.pi:
        raise SceneError(f"chain: lean is {lean:g} rad; give at most a right angle, 1.57")
    shape = ArchShape(pitch=np.linspace(lean, -lean, count).tolist(), pattern=pattern)
    provenance = "Generated by seqopt.scene.library.chain."
    scene = arch_scene(shape, f"chain {count}", provenance=provenance)
    remedy = "give more bricks or a smaller lean"
    require_apart(f"chain of {count}", scene.bricks, remedy, _AT_CORNERS)
    return scene
