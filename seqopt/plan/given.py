"""A sequence that is given, of a fixed method or a file, with everything that a plan can show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.plan.build import ShownBuild
from seqopt.responses.table import analyze
from seqopt.sequence.steps import Step, check_sequence, require_steps


@dataclass(frozen=True, repr=False)
class GivenSequence(ShownBuild):
    """Steps that were not optimized: those of a fixed method, or of a file.

    Parameters
    ----------
    engine : Engine
        What computes the responses; it has the scene.
    steps : tuple of Step
        Of `seqopt.sequential`, `seqopt.cantilever` or `seqopt.read_plan`.
    title : str, optional
        What it is called beside others.

    Attributes
    ----------
    seconds : mapping of str to float
        Empty: nothing was searched.

    Raises
    ------
    SceneError, StepError
        If an argument is not an engine or not a list of steps, or the steps are impossible.

    Examples
    --------
    >>> import seqopt
    >>> engine = seqopt.make_engine("auto", seqopt.build_network(seqopt.load_scene("arch25")))
    >>> build = seqopt.GivenSequence(engine, seqopt.sequential(engine.network), "sequential")
    >>> build
    <GivenSequence sequential of arch25: 49 steps>
    >>> float(build.grips()["largest_force_N"].max().round(1))
    406.1
    """

    engine: Engine
    steps: tuple[Step, ...]
    title: str = "sequence"
    seconds: Mapping[str, float] = field(default_factory=dict, compare=False, hash=False)

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.engine, "network", None), Network):
            kind = type(self.engine).__name__
            raise SceneError(f"a {kind} is not an engine; give seqopt.make_engine('auto', scene)")
        check_sequence(self.engine.network.scene, require_steps(self.steps))

    def __repr__(self) -> str:
        name = self.engine.network.scene.name
        return f"<GivenSequence {self.title} of {name}: {len(self.steps)} steps>"

    @property
    def worth(self) -> str:
        """What it is worth, in words."""
        return "given, not optimized"

    def table(self) -> pd.DataFrame:
        """Return every grip.

        Result: as of `grips`.
        """
        return self.grips()

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step.

        Result: as of `seqopt.analyze`.
        """
        return analyze(self.engine, self.steps)
