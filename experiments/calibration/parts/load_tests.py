r"""Calibration of joint stiffness by load tests: identifiable factors, and their intervals.

A test is a force on a brick of a scene and how far the loaded point moved along it. All joints and
ground ends of all scenes are made stiffer by two factors, one in translation and one in rotation,
until computed displacements come closest to measured ones: least squares of logarithms, so that
tests of any size have equal weight.

Displacements are in proportion to :math:`1/k`. So the share :math:`s` of a displacement that is due
to joints that turn says all of what a test tells: it fixes :math:`k_t^{1-s} k_r^s`. Two factors are
fixed apart only by tests whose shares differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from seqopt.arrays import Floats, Terse
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.parts import Load
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene

_NEEDED = ("scene", "brick", "force_x_N", "force_y_N", "force_z_N", "displacement_mm")
_PLACE = ("x_m", "y_m", "z_m")
_MOST = np.log(1e6)  # of a factor, up or down
_OPEN = 10.0  # an interval that is wider, up or down, fixes nothing
_ALIKE = 1e-4  # spread of shares over the tests below which factors are not told apart


@dataclass(frozen=True, repr=False)
class StiffnessFit(Terse):
    """The factors on joint stiffness with which computed displacements come closest to measured.

    Attributes
    ----------
    translational, rotational : float
        Factors on what the scenes say; of an open one, some value that fits.
    intervals : tuple of 2 (float, float)
        Between which values they lie with 95 %, if errors are random; from 0 to infinity where the
        tests do not fix one.
    combined : tuple of (float, float, float)
        What is known best: a factor k_t^(1 - s) k_r^s, the s, and by which factor it may be wrong.
    tests : pandas.DataFrame
        Those given, with ``computed_mm``, ``error_percent`` and ``turning_share``.
    fixes : str
        What the tests fix and what not, in words.
    """

    translational: float
    rotational: float
    intervals: tuple[tuple[float, float], tuple[float, float]]
    combined: tuple[float, float, float]
    tests: pd.DataFrame
    fixes: str


def calibrate(tests: pd.DataFrame) -> StiffnessFit:
    """Fit factors on joint stiffness to load tests, with confidence intervals.

    Parameters
    ----------
    tests : pandas.DataFrame
        A row per test: ``scene`` (a `Scene`, or what `load_scene` takes), ``brick``,
        ``force_x_N``, ``force_y_N``, ``force_z_N``, optionally where it acts, ``x_m``, ``y_m`` and
        ``z_m``, and ``displacement_mm``, what that point moved along the force.

    Returns
    -------
    StiffnessFit

    Raises
    ------
    SceneError
        If a column is missing, or a row is no test.

    Examples
    --------
    >>> down = {"scene": "chain:bricks=7", "force_x_N": 0.0, "force_y_N": 0.0, "force_z_N": -100.0}
    >>> rows = [{**down, "brick": 3, "displacement_mm": mm} for mm in (0.011, 0.012)]
    >>> calibrate(pd.DataFrame(rows)).fixes.split(";")[0]
    'fixed: neither alone'
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  # slow to import, for this only

    missing = [name for name in _NEEDED if name not in tests]
    if missing or not len(tests):
        what = f"columns {', '.join(missing)} are missing" if missing else "there is none"
        raise SceneError(f"tests: {what}; give a row per test with {', '.join(_NEEDED)}")
    loaded = [_loaded(number, row) for number, row in enumerate(tests.to_dict("records"), 1)]
    measured = np.log(1e-3 * tests["displacement_mm"].to_numpy(dtype=float))

    def errors(logs: Floats) -> Floats:
        moved = np.array([_displacement(network, *np.exp(logs)) for network in loaded])
        return np.asarray(np.log(moved) - measured)

    found = least_squares(errors, np.zeros(2), bounds=(-_MOST, _MOST))
    logs, left, slopes = (np.array(part, dtype=float) for part in (found.x, found.fun, found.jac))
    share = np.clip(-slopes[:, 1], 0.0, 1.0)
    table = tests.assign(
        computed_mm=tests["displacement_mm"] * np.exp(left),
        error_percent=100 * np.expm1(left),
        turning_share=share,
    )
    return _judged(logs, left, share, table)


def _loaded(number: int, row: Mapping[Any, Any]) -> Network:
    """Return the network of a test with its load as the only one."""
    where, moved = f"test {number}", row["displacement_mm"]
    if not isinstance(moved, int | float) or not 0 < moved < np.inf:
        raise SceneError(f"{where}: displacement_mm is {moved}; give mm along the force")
    scene = row["scene"] if isinstance(row["scene"], Scene) else load_scene(row["scene"])
    place = tuple(row.get(name, np.nan) for name in _PLACE)
    force = row["force_x_N"], row["force_y_N"], row["force_z_N"]
    load = Load(brick=row["brick"], force=force, position=None if pd.isna(place[0]) else place)
    if not any(load.force):
        raise SceneError(f"{where}: its force is zero; give N")
    still = tuple(replace(ground, movement=None) for ground in scene.grounds)
    bare = replace(scene, wind=(0.0, 0.0, 0.0), weight_factor=0.0, grounds=still)
    return build_network(replace(bare, loads=(load,)))


def _displacement(network: Network, shift: float, turn: float) -> float:
    """Return how far the loaded point moves along the force with factors on stiffness, m."""
    springs, count = network.springs, len(network.inner)
    stiffer = replace(
        springs,
        translational_stiffness=shift * springs.translational_stiffness,
        rotational_stiffness=turn * springs.rotational_stiffness,
    )
    engine = ComplianceEngine(replace(network, springs=stiffer))
    twists = engine.solve(count, np.zeros((1, 0), dtype=np.int64), Want.BRICKS).brick_twist[0]
    work = (twists * network.applied(count)).sum()
    return float(work / np.linalg.norm(network.scene.loads[0].force))


def _judged(logs: Floats, errors: Floats, share: Floats, table: pd.DataFrame) -> StiffnessFit:
    """Return the fit with its quality, by its errors and shares of turning."""
    middle, spread, tests = float(share.mean()), float(share.std()), len(share)
    apart = spread > _ALIKE and tests > 1
    rows = np.stack([1 - share, share], axis=1)
    half, most = np.full(2, np.inf), np.inf
    if tests > 1 + apart:
        from scipy.special import stdtrit  # noqa: PLC0415  # slow to import, for this only

        sigma = np.sqrt((errors**2).sum() / (tests - 1 - apart))
        likely = float(stdtrit(tests - 1 - apart, 0.975))
        most = likely * sigma / np.sqrt(tests)
        if apart:
            half = likely * sigma * np.sqrt(np.linalg.inv(rows.T @ rows).diagonal())
    if not apart and min(middle, 1 - middle) < _ALIKE:
        half[int(middle > 0.5)] = most
    closed = half < np.log(_OPEN)
    lowest, highest = np.exp(np.where(closed, [logs - half, logs + half], [[-np.inf], [np.inf]]))
    first, second = zip(lowest.tolist(), highest.tolist(), strict=True)
    shift, turn = np.exp(logs).tolist()
    both = float(np.exp(logs @ [1 - middle, middle])), middle, float(np.exp(most))
    names = np.array(["translational", "rotational"])
    said = f"fixed: {' and '.join(names[closed]) or 'neither alone'}"
    if not closed.all():
        said += f"; not fixed: {' and '.join(names[~closed])}"
    if not apart:
        said += "; joints turn for the same share of every displacement"
    if tests <= 1 + apart:
        said += "; as many numbers as tests, so nothing says how sure"
    return StiffnessFit(shift, turn, (first, second), both, table, said)
