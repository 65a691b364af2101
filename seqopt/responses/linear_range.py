"""Whether results lie where they mean something: small displacements, and joints that stay elastic.

Engines are linear: they answer loads of any size, also where a structure would have moved so far
that its shape is another one, or its joints would have broken. What a build reaches is compared
here with what the theory allows; each limit follows from the scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.contact.elastic_limits import ElasticLimits, find_elastic_limits
from seqopt.contact.mortar import EPOXY
from seqopt.engines.auto import AutoEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.discrete.equilibrium_path import FAR
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import SceneError
from seqopt.responses.quantities import RESPONSES, length_text, lengths, steps_in_words

_TURN = 0.1  # rad; sine and angle differ by 0.2 %, cosine and one by 0.5 %
_STRAIN = 0.1  # of a joint, over its thickness; true strain differs by 5 %
_DEFORMED = f"{{:.3g}} times its thickness, more than {_STRAIN:g} times"
_STRESSED = (
    f"{{:.3g}} MPa beyond what epoxy holds, {EPOXY.tensile_strength / 1e6:g} MPa in tension, "
    f"{EPOXY.cohesion / 1e6:g} MPa and friction in shear"
)
OUTSIDE = "outside the linear range"
REMEDY = (
    "Do not rely on numbers outside the linear range. Check sizes, densities and stiffnesses of "
    "the scene; make joints stiffer, let robots hold more or other nodes, or set a limit on D_max. "
    "Where only stress is too large, the engine auto lets joints open and break."
)


@dataclass(frozen=True)
class Departure:
    """A limit of the linear range that some steps leave."""

    what: str  # what is too large, in a word or two
    said: str  # the largest value, the limit, and why it is one
    steps: tuple[int, ...]  # numbers of the steps

    def __str__(self) -> str:
        return f"{self.what} of up to {self.said} ({steps_in_words(self.steps)})"


class LinearRange:
    """Finds the steps of builds in which an engine's results leave the linear range.

    ``unchecked``: why stresses in joints are not checked, if they should be: in a line, or none.
    """

    def __init__(self, engine: Engine) -> None:
        self._network = engine.network
        self._breaks = isinstance(engine, AutoEngine | DiscreteEngine)
        self._engine = engine.rigid if isinstance(engine, AutoEngine) else engine
        self._known: dict[tuple[int, tuple[int, ...]], Floats] = {}
        self._limits: ElasticLimits | None = None
        thickness = engine.network.springs.thickness
        self._thickness = np.where(np.isnan(thickness) | self._breaks, np.inf, thickness)
        self.unchecked: tuple[str, ...] = ()
        try:
            self._limits = None if self._breaks else find_elastic_limits(engine.network, EPOXY)
        except SceneError as error:
            self.unchecked = (f"stresses in joints are not checked: {error}",)

    def departures(
        self, table: pd.DataFrame, fields: Iterable[Fields] | None = None
    ) -> tuple[Departure, ...]:
        """Return the limits that the steps of a build leave.

        ``table``: responses of the steps, from `seqopt.analyze`. ``fields``: of every step, with
        all fields; by default the engine computes them.

        Examples
        --------
        >>> import seqopt
        >>> from seqopt.responses.linear_range import LinearRange
        >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
        >>> table = seqopt.analyze(engine, seqopt.sequential(engine.network))
        >>> LinearRange(engine).departures(table)
        ()
        """
        scene, shift = self._network.scene, RESPONSES["D_max"]
        far = FAR * min(min(brick.dimensions) for brick in scene.bricks)
        moved = table[shift.column].to_numpy(float) / shift.scale
        turned, strained, stressed = self._measured(table, fields).T
        within = f", more than {length_text(far)}, a tenth of the smallest side of a brick"
        found = (
            ("displacement", moved, far, lambda most: length_text(most) + within),
            ("rotation", turned, _TURN, f"{{:.3g}} rad, more than {_TURN:g} rad".format),
            ("deformation of a joint", strained, _STRAIN, _DEFORMED.format),
            ("stress in a joint", stressed, 0.0, lambda most: _STRESSED.format(most / 1e6)),
        )
        out = []
        for what, values, most, say in found:
            over = ~(values <= most)  # what is not a number is not within
            if over.any():
                steps = tuple(int(number) for number in table["step"][over])
                out.append(Departure(what, say(float(values[over].max())), steps))
        return tuple(out)

    def of_builds(self, tables: Mapping[str, pd.DataFrame]) -> dict[str, tuple[Departure, ...]]:
        """Return the limits that builds leave, for those that leave any.

        ``tables``: responses of the steps of each, by name.
        """
        return {name: left for name, each in tables.items() if (left := self.departures(each))}

    def _measured(self, table: pd.DataFrame, fields: Iterable[Fields] | None) -> Floats:
        """Return rotation, strain and excess of stress of every step, (steps, 3)."""
        if fields is not None:
            return np.array([self._of(each) for each in fields])
        if isinstance(self._engine, DiscreteEngine):
            return np.full((len(table), 3), -np.inf)  # whoever goes far is unstable there
        nodes = table[[f"{robot.name}_node" for robot in self._network.scene.robots]]
        held = (tuple(int(n) for n in row if pd.notna(n)) for row in nodes.to_numpy(object))
        keys = [*zip(map(int, table["bricks"]), held, strict=True)]
        for bricks, grips in dict.fromkeys(keys):  # in order: engines grow with the build
            if (bricks, grips) in self._known:
                continue
            asked = np.array([grips], dtype=np.int64).reshape(1, -1)
            found = self._engine.solve(bricks, asked, Want.BRICKS | Want.JOINTS)
            self._known[bricks, grips] = self._of(found)
        return np.array([self._known[key] for key in keys])

    def _of(self, fields: Fields) -> Floats:
        """Return rotation, rad, strain, and stress beyond the elastic limit, Pa, of one step."""
        springs = self._network.springs
        wrench = fields.joint_wrench[0].reshape(-1, 2, 3) @ springs.axes.transpose(0, 2, 1)
        stiffness = springs.stiffness.reshape(-1, 2, 3)
        given = np.divide(wrench, stiffness, out=np.zeros_like(wrench), where=stiffness > 0)
        shift, turn = lengths(given).T
        turns = np.concatenate([turn, lengths(fields.brick_twist[0][:, 3:])])
        if self._limits is None:
            return np.array([turns.max(), (shift / self._thickness).max(), -np.inf])
        face = self._limits.assembly.contact
        lever = lengths(self._limits.assembly.corner - springs.position[face])
        strain = (shift[face] + turn[face] * lever) / self._thickness[face]
        return np.array([turns.max(), strain.max(), self._limits.excess(fields.joint_wrench).max()])


def builds_in_words(departures: Mapping[str, Sequence[Departure]]) -> tuple[str, ...]:
    """Return which builds leave the linear range, and by what.

    ``departures``: by the name of the build. Result: of one line, or none.

    Examples
    --------
    >>> builds_in_words({"a": [Departure("rotation", "1 rad, more than 0.1 rad", (3,))], "b": ()})
    ('a (rotation)',)
    """
    left = [name for name, each in departures.items() if each]
    what = dict.fromkeys(one.what for each in departures.values() for one in each)
    return (f"{', '.join(left)} ({', '.join(what)})",) if left else ()
