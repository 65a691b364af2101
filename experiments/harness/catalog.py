"""Where claims stand: every module of a topic's folder makes one, its ``parts`` make none."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from experiments.harness.claim import Claim, ClaimError

HOME = Path(__file__).resolve().parent.parent
HARNESS = "harness"


def modules(home: Path = HOME) -> dict[str, str]:
    """Return the modules that make claims, dotted, by their plain names in alphabetical order.

    Raises
    ------
    ClaimError
        If there are none, or if two have one name.
    """
    found: dict[str, str] = {}
    for path in (*home.glob("*.py"), *home.glob("*/*.py")):
        if path.stem.startswith("__") or path.parent.name == HARNESS:
            continue
        module = ".".join(path.relative_to(home.parent).with_suffix("").parts)
        if path.stem in found:
            raise ClaimError(f"two experiments are named {path.stem}: {found[path.stem]}, {module}")
        found[path.stem] = module
    if not found:
        raise ClaimError(f"no experiments found in {home}: one per file in a folder by topic")
    return dict(sorted(found.items()))


def claims() -> dict[str, Claim]:
    """Return what every experiment declares, by its plain name.

    Raises
    ------
    ClaimError
        If one declares nothing, or as `modules` does.
    """
    out = {}
    for name, module in modules().items():
        claim = getattr(import_module(module), "CLAIM", None)
        if not isinstance(claim, Claim):
            raise ClaimError(f"{module} declares no CLAIM: what makes none belongs in parts")
        out[name] = claim
    return out
