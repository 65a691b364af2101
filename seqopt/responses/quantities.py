"""Each response, defined once, as a function of the fields of grip sets.

A response has the name that criteria and limits use, the column it has in tables, and the fields it
needs. Sizes of grip forces are functions of their own, since there is one per robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.engines.rigid.compliance import Extremes
from seqopt.errors import SolverError
from seqopt.network.network import Network
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

_LISTED = 12  # steps that are named one by one
TOLERANCE = "tolerance"
"""A response like others, but that more is better: how far every grip may be off before a robot
carries more than its payload, or a limit is exceeded. Counted by its reciprocal, 1/m."""
NO_TOLERANCE = 1e30  # its reciprocal where there is none
PROP_EXCESS = "prop_excess"
"""A response that is there where a scene has props: by how much the force of any is more than it
may be, N: beyond its capacity, or a pull of one that only pushes."""
_SLACK = 1e-6  # an edge is in tension above this share of the mean weight of a brick
_LEVEL = 1e-9  # share of a force that may point down where it counts as level
TO_1E_3MM = 1e6  # from m to the tables' unit of length, 1e-3 mm
_TAKEN = {"rob", "prop", "max", "move", "largest", "each"}  # beside RESPONSES: other meanings of F_
_MARKS = set("[]=,;")  # of the language of criteria, limits and tables
EXCESS_COLUMN = "prop_excess_N"


def _number_text(value: float) -> str:
    """Return a number with at least four digits, and no power of ten where it can be read.

    >>> _number_text(27.88), _number_text(116312.4)
    ('27.88', '116,312')
    """
    return f"{value:,.0f}" if 1e4 <= abs(value) < 1e12 else f"{value:.4g}"


def length_text(length: float) -> str:
    """Return a length in words, in the unit that suits it.

    >>> length_text(2.79e-5), length_text(0.1163), length_text(3e-7), length_text(0.0)
    ('27.9 µm', '116.3 mm', '300 nm', '0 mm')
    """
    for unit, size in (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)):
        if abs(length) >= 0.9999 * size:
            return f"{length / size:.4g} {unit}"
    return f"{length * 1e3:.4g} mm"


def _payload_text(force: float) -> str:
    """Format a sufficient payload for a force: whole newtons, at most three digits, rounded up.

    >>> _payload_text(211.9), _payload_text(12_345.0), _payload_text(212.0)
    ('212', '12400', '212')
    """
    return f"{_rounded_up(force, 1.0):.10g}"


def _rounded_up(value: float, unit: float = 0.0) -> float:
    """Return the next number that has three digits, or is whole in a larger unit; from zero on.

    >>> _rounded_up(0.45678), _rounded_up(57.2, 1.0), _rounded_up(57.0)
    (0.457, 58.0, 57.0)
    """
    if not value > 0 or math.isinf(value):
        return value
    step = max(unit, 10.0 ** (math.floor(math.log10(value)) - 2))
    return float(f"{math.ceil(value / step - 1e-9) * step:.12g}")


def _plain(value: float, digits: int) -> str:
    """Return a number to so many digits, never with a power of ten.

    >>> _plain(168.2, 2), _plain(504_820.0, 3), _plain(0.2312, 2)
    ('170', '505,000', '0.23')
    """
    return f"{float(f'{value:.{digits}g}'):,.10g}"


def _steps_in_words(steps: Sequence[int]) -> str:
    """Return which steps these are, by their numbers; of many the first.

    >>> _steps_in_words([3]), _steps_in_words(range(1, 20))
    ('step 3', 'steps 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 and 7 more')
    """
    more = f" and {len(steps) - _LISTED} more" if len(steps) > _LISTED else ""
    return f"step{'s' * (len(steps) > 1)} {', '.join(map(str, steps[:_LISTED]))}{more}"


@dataclass(frozen=True)
class Response:
    """A scalar response of a partial structure to its weight and its grips.

    Attributes
    ----------
    name : str
        As Bruun et al. write it.
    column : str
        In tables, with the unit there.
    scale : float
        From SI units to the column's.
    needs : Want
        The fields it is evaluated from.
    of : callable
        Takes the network and the fields of S grip sets, returns (S,) float in SI units.
    """

    name: str
    column: str
    scale: float
    needs: Want
    of: Callable[[Network, Fields], Floats]


def lengths(vectors: Floats) -> Floats:
    """Return the lengths (...) of vectors (..., 3)."""
    x, y, z = (vectors[..., i] for i in range(3))  # adding whole arrays outruns sums of three
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def robot_response(robot: str) -> str:
    """Return the unique name of the force of a robot's grip.

    It is ``F_`` and the robot's name; where that means something else already, or cannot be read
    back from a list, the name stands in brackets.

    >>> robot_response("rob1"), robot_response("sup"), robot_response("a,b")
    ('F_rob1', 'F_[sup]', 'F_[a,b]')
    """
    of_an_end = robot.startswith("sup_")  # `seqopt.responses.table.support_columns`
    means_more = robot in _TAKEN or of_an_end or f"F_{robot}" in RESPONSES or _MARKS & set(robot)
    return f"F_[{robot}]" if means_more or not robot.strip() else f"F_{robot}"


def require_finite(name: str, values: Floats, bricks: int) -> Floats:
    """Return values of a response if all are finite: NaN elsewhere means that a robot holds none.

    Raises `SolverError` if one is not.
    """
    if not np.isfinite(values).all():
        raise SolverError(
            f"{bricks} bricks: {name} is not finite; correct lengths, masses or stiffnesses "
            "beyond all bounds in the scene, or the engine"
        )
    return values


def grip_forces(network: Network, fields: Fields) -> Floats:
    """Return the size (S, r) of every grip force, N, negative down; F_rob of Bruun et al."""
    return _signed(network, fields.grip_force)


def support_forces(network: Network, fields: Fields) -> Floats:
    """Return the size (S, G) of the reaction at every ground end, N, negative down.

    Zero where the end does not act yet. Ends in the scene's order.
    """
    return _signed(network, fields.support[..., :3])


def support_moments(fields: Fields) -> Floats:
    """Return the size (S, G) of the moment at every ground end about its fixed point, N m."""
    return lengths(fields.support[..., 3:])


def _signed(network: Network, vectors: Floats) -> Floats:
    size = lengths(vectors)
    return np.asarray(np.copysign(size, vectors @ np.array(network.scene.up) + _LEVEL * size))


def _largest_force(network: Network, fields: Fields) -> Floats:
    """Return the support force of largest size (S,), signed; of two as large the one upward."""
    forces = support_forces(network, fields)
    up, down = forces.max(axis=1), forces.min(axis=1)
    return np.asarray(np.where(up >= -down, up, down))


def _in_tension(network: Network, fields: Fields) -> Floats:
    weight = float(np.linalg.norm(network.weight, axis=1).mean())
    return np.asarray(100 * (fields.edge_force > _SLACK * weight).mean(axis=1))


_EDGES, _SUPPORT = (1.0, Want.EDGES), (1.0, Want.SUPPORT)
_MOTION = (TO_1E_3MM, Want.DISPLACEMENTS)
RESPONSES: dict[str, Response] = {
    response.name: response
    for response in (
        Response("F_sup", "F_sup_N", *_SUPPORT, _largest_force),
        Response("M_sup", "M_sup_Nm", *_SUPPORT, lambda _, f: support_moments(f).max(axis=1)),
        Response("F_min", "F_min_N", *_EDGES, lambda _, f: f.edge_force.min(axis=1)),
        Response("T_max", "F_max_N", *_EDGES, lambda _, f: f.edge_force.max(axis=1)),
        Response("F_avg", "F_avg_N", *_EDGES, lambda _, f: f.edge_force.mean(axis=1)),
        Response("T_pct", "T_pct", *_EDGES, _in_tension),
        Response("D_max", "D_max_1e-3mm", *_MOTION, lambda _, f: lengths(f.displacement).max(1)),
        Response("D_avg", "D_avg_1e-3mm", *_MOTION, lambda _, f: lengths(f.displacement).mean(1)),
        Response("D_std", "D_std_1e-3mm", *_MOTION, lambda _, f: lengths(f.displacement).std(1)),
    )
}
"""By name, in the order of the columns of Table A.1.

``F_sup`` is the largest force at any ground end, signed like a grip's, ``M_sup`` the largest moment
at any, about the end's fixed point (Bruun et al. print those of the first end);
``F_min``, ``T_max`` and ``F_avg`` run over the axial forces of all edges, tension positive;
``T_pct`` is the share of edges in tension, percent; ``D_max``, ``D_avg`` and ``D_std`` run over the
displacements of all nodes.
"""


_C_MAX = Response("C_max", "C_max_N", *_EDGES, lambda _, f: np.maximum(0.0, -f.edge_force.min(1)))
CHOSEN_BY: dict[str, Response] = {**RESPONSES, _C_MAX.name: _C_MAX}
"""Responses that criteria and limits can name: those of the tables, and ``C_max``, the largest
compression of any edge as a size, N (``F_min`` without its sign; zero if no edge is compressed).
"""

OFFERED = ("T_max", "M_sup", "D_max", "C_max")
"""Names of `CHOSEN_BY` that aims, criteria and limits take, of every kind of schedule."""


EXTREMES: Mapping[str, Callable[[Extremes], Floats]] = {
    "T_max": lambda found: found.most,
    "F_min": lambda found: found.least,
    "C_max": lambda found: np.maximum(0.0, -found.least),
    "D_max": lambda found: found.shift,
    "M_sup": lambda found: found.moment,
}
"""Responses that are extremes of fields, which need not be written down themselves."""


def responses_of(network: Network, fields: Fields) -> dict[str, Floats]:
    """Return all responses of S grip sets with r grips each, SI units.

    Parameters
    ----------
    network : Network
        The network that the fields run over.
    fields : Fields
        With edge forces, displacements and the supports (`Want.RESPONSES`).

    Returns
    -------
    dict of str to (S,) float
        As in `RESPONSES`, and the signed grip forces (S, r) as ``F_rob``.
    """
    found = {name: response.of(network, fields) for name, response in RESPONSES.items()}
    return {"F_rob": grip_forces(network, fields), **found}


def _excess_of(props: Sequence[Prop], force: Floats) -> Floats:
    """Return by how much forces (S, p, 3) of props exceed what they bear at most, (S,), N."""
    out = np.zeros(len(force))
    for prop, own in zip(props, force.transpose(1, 0, 2), strict=True):
        if prop.capacity is not None:
            out = np.maximum(out, lengths(own) - prop.capacity)
        if prop.direction is not None:
            out = np.maximum(out, -own @ np.array(prop.direction))
    return np.asarray(out)


def _prop_cells(scene: Scene, step: Step, force: Floats) -> dict[str, object]:
    """Return the cells of props in a table of steps, from their forces (p, 3)."""
    if not scene.props:
        return {}
    props = scene.standing_props(step.bricks, held=bool(step.held))
    size = lengths(force)
    most = int(size.argmax()) if len(props) else 0
    return {
        "props": len(props),
        "prop_node": props[most].node if len(props) else None,
        "F_prop_N": float(size[most]) if len(props) else np.nan,
        EXCESS_COLUMN: float(_excess_of(props, force[None])[0]),
    }


def _props_table(engine: Engine, steps: Sequence[Step]) -> pd.DataFrame:
    """Return a row per prop of a build: the steps in which it holds, and its forces.

    Columns: ``node``, ``brick``, ``from_step``, ``to_step``, ``largest_force_N``, ``at_step``, and
    of one that only pushes ``least_push_N``, negative if it would have to pull.
    """
    scene = engine.network.scene
    found: dict[int, list[tuple[int, Floats]]] = {}
    for step in steps:
        props = scene.standing_props(step.bricks, held=bool(step.held))
        if props:
            numbers = [scene.grip_numbers(step.grips, step.bricks)]
            force = engine.solve(step.bricks, numbers, Want(0)).grip_force[0, len(step.held) :]
            for prop, own in zip(props, force, strict=True):
                found.setdefault(scene.props.index(prop), []).append((step.number, own))
    rows = []
    for index, held in sorted(found.items()):
        prop, force = scene.props[index], np.array([own for _, own in held])
        pushed = None if prop.direction is None else force @ np.array(prop.direction)
        row = {
            "node": prop.node,
            "brick": scene.brick_of_node[prop.node].name,
            "from_step": held[0][0],
            "to_step": held[-1][0],
            "largest_force_N": float(lengths(force).max()),
            "at_step": held[int(lengths(force).argmax())][0],
            "least_push_N": np.nan if pushed is None else float(pushed.min()),
        }
        rows.append(row)
    return pd.DataFrame(rows)
