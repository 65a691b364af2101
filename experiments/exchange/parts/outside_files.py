"""Assemblies that the project did not make, where they are, and what their files do not say.

Those of compas_cra come with its wheel (MIT license). Others are in public repositories; none of
their files is kept here. Clones of these repositories beside each other, at the commits named,
make a folder in which `find` looks.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

WHEEL = "compas_cra 0.8.0"
COMMITS = {
    "compas_assembly": "53f8969d",
    "compas_dem": "559107e",
    "compas_timber": "ab12122a3d",
    "conmech": "9f24230",
    "sequencer_benchmark": "f6fe47e",
}


@dataclass(frozen=True)
class Outside:
    """A file of others, and the words that ``seqopt import`` needs beside it."""

    source: str
    path: str
    words: tuple[str, ...] = ("--unit", "m", "--density", "2400")

    @property
    def name(self) -> str:
        """Short, and its own among all."""
        return f"{self.source.split()[0]}: {self.path}"


def _sample(name: str, supports: str = "", *words: str) -> Outside:
    given = ("--supports", supports) if supports else ()
    plain = ("--unit", "m", "--density", "2400")
    return Outside(WHEEL, f"{name}.json", (*plain, *given, *words))


SAMPLES = (
    *(
        _sample(name, "0,1")
        for name in ("A", "H", "bridge", "type-a", "type-b", "type-c", "type-d")
    ),
    *(_sample(f"shelf{part}", "0") for part in ("", "-s1", "-s2", "-s3", "-stable")),
    *(_sample(f"{kind}", "0") for kind in ("concave-short", "concave-long", "curve-3-blocks")),
    *(_sample(f"cube-curve-{kind}", "0") for kind in ("short", "tall")),
    _sample("cubes", "0"),
    _sample("snake", "0", "--gap", "0.01"),
    _sample("armadillo"),  # it marks no supports, and nothing in it stands level
    _sample("armadillo_cra"),  # it marks them
)
LARGE = ("--unit", "m")  # with a density of its own
TIMBER = ("--unit", "mm", "--density", "450")
ELSEWHERE = (
    *(
        Outside("compas_assembly", f"docs/examples/{name}_assembly.json")
        for name in ("arch", "stack", "wall", "crossvault", "dome", "two-blocks")
    ),
    *(
        Outside("compas_assembly", f"data/__temp/{name}.json")
        for name in ("wall_courses", "wall_interfaces", "dome", "curvedwall", "stack", "ursula")
    ),
    Outside("compas_assembly", "data/__temp/amiens_internet.json"),
    Outside("compas_dem", "data/dem_crossvault.json"),
    Outside("compas_dem", "scripts/DEM_Analysis_References/Barrel_Vault/DEM_model.json", LARGE),
    Outside("compas_dem", "scripts/DEM_Analysis_References/Barrel_Vault/DEM_problem.json", LARGE),
    Outside("compas_dem", "data/wall.obj"),
    Outside("compas_dem", "data/dome.obj"),
    Outside("compas_dem", "data/ursula.obj"),
    Outside("compas_dem", "data/pavillionvault/blocks.json"),
    Outside("compas_timber", "data/model_test.json", TIMBER),
    Outside(
        "compas_timber",
        "examples/structural/reciprocal_2_dev0.json",
        ("--unit", "m", "--density", "450"),
    ),
    *(
        Outside("conmech", f"tests/test_data/{name}.json", ())
        for name in ("four-frame", "tower_3D", "topopt-100", "mgz_flat_beam")
    ),
    Outside("sequencer_benchmark", "data/benchmark/benchmark-1/opt-holistic/108693.json", ()),
)


def find(outside: Outside, folder: str) -> Path | None:
    """Return where a file is, if it is: in the wheel, or below a folder of repositories."""
    home = Path(folder, outside.source)
    if outside.source == WHEEL:
        home = Path(import_module("compas_cra").SAMPLE)
    path = home / outside.path
    return path if path.is_file() and (folder or outside.source == WHEEL) else None
