"""Every method on one scene, side by side, beside what the study printed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import StepError
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import IRREGULARITIES, PAPER_COLUMN, is_reference_arch, published_plan
from seqopt.study.tables import printed


@dataclass(frozen=True)
class Comparison:
    """Methods side by side.

    Attributes
    ----------
    maxima : pandas.DataFrame
        A row per quantity (with its unit), a column per method: the largest value of any step.
    printed : pandas.DataFrame or None
        The same as the study prints it (its improvement table), for its own arch only.
    tables : mapping of str to pandas.DataFrame
        Responses of every step, by method.
    notes : tuple of str
        Payloads exceeded, and what does not add up in the study's own numbers.
    """

    maxima: pd.DataFrame
    printed: pd.DataFrame | None
    tables: Mapping[str, pd.DataFrame]
    notes: tuple[str, ...]


def compare_methods(engine: Engine) -> Comparison:
    """Analyze every method that exists for the engine's scene.

    Raises
    ------
    StepError
        If no method can build the scene.
    """
    scene = engine.network.scene
    tables, notes, refused = {}, [], []
    for name, method in METHODS.items():
        try:
            tables[name] = analyze(engine, method(engine.network))
        except StepError as error:
            refused.append(error)
            notes.append(f"{name}: not possible here; {error}")
    if not tables:
        raise refused[0]
    if is_reference_arch(scene):
        tables["three-robot"] = analyze(engine, published_plan(scene))
    maxima = pd.DataFrame({name: _maxima(scene, table) for name, table in tables.items()})
    notes += _overloads(scene, tables)
    reference = None
    if is_reference_arch(scene):
        notes += [f"In the study: {text}" for text in IRREGULARITIES]
        printed_maxima = printed("improvement_3robot").drop(columns=["quantity", "unit"])
        columns = [PAPER_COLUMN[name] for name in tables]
        reference = printed_maxima.set_axis(maxima.index)[columns].set_axis(list(tables), axis=1)
    return Comparison(maxima, reference, tables, tuple(notes))


def _maxima(scene: Scene, table: pd.DataFrame) -> pd.Series[float]:
    values = {
        f"F_{robot.name} [N]": table[f"F_{robot.name}_N"].abs().max() for robot in scene.robots
    }
    values["M_sup [N m]"] = table["M_sup_Nm"].max()
    values["T_max [N]"] = table["F_max_N"].max()
    values["D_max [1e-3 mm]"] = table["D_max_1e-3mm"].max()
    return pd.Series(values)


def _overloads(scene: Scene, tables: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    for name, table in tables.items():
        for robot in scene.robots:
            force = table[f"F_{robot.name}_N"].abs()
            over = table["step"][force > robot.payload]
            if len(over):
                steps = ", ".join(map(str, over))
                yield (
                    f"{name}: {robot.name} holds up to {force.max():.1f} N, more than its payload "
                    f"of {robot.payload:g} N (step {steps})."
                )


def format_comparison(comparison: Comparison, scene: Scene) -> str:
    """Return the comparison as text: under each method our value and, if any, the study's."""
    maxima, study = comparison.maxima, comparison.printed
    width = 12 if study is None else 22
    lines = [f"{scene.name}: {len(scene.bricks)} bricks; largest response of any step", ""]
    lines.append(f"{'':16}" + "".join(f"{name:>{width}}" for name in maxima))
    if study is not None:
        lines.append(f"{'':16}" + f"{'seqopt':>14}{'study':>8}" * maxima.shape[1])
    for row, quantity in enumerate(maxima.index):
        cells = ""
        for column in range(maxima.shape[1]):
            own = _number(maxima.iloc[row, column])
            cells += (
                f"{own:>12}" if study is None else f"{own:>14}{_number(study.iloc[row, column]):>8}"
            )
        lines.append(f"{quantity:16}{cells}")
    lines += ["", "Notes"]
    lines += [f"- {note}" for note in comparison.notes] or ["- none"]
    return "\n".join(lines)


def _number(value: object) -> str:
    number = float(str(value))
    return "-" if np.isnan(number) else f"{number:.1f}"
