"""The picture of the design, held against every import."""

from __future__ import annotations

import ast
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parent.parent

LAYERS = (
    {"errors"},
    {"vectors", "files", "batch_solve"},
    {"reach"},
    {"scene"},
    {"network"},
    {"arch", "scene_file", "statics", "steps", "placement", "criteria", "plane"},
    {"kinematics", "tree", "methods", "plan_file", "paper", "schedule", "selection"},
    {"operator", "fields", "draw", "loops"},
    {"rigid", "responses", "states", "assembly"},
    {"problem", "contact", "equilibrium", "mixed", "bed", "friction_law"},
    {"budgets", "ranking", "proof", "diagnosis", "elastic", "discrete_system"},
    {"optimize", "stability", "discrete_solve"},
    {"compliance", "frame", "discrete"},
    {"planar"},
    {"fidelity"},
    {"engines", "compare", "search"},
    {"contest", "arguments", "certificates"},
    {"charts"},
    {"cli"},
    {"__main__", "__init__"},
)  # a module imports from layers above it in this list only
SOLVERS = {"cvxpy", "clarabel", "highspy"}
SOLVER_HOME = "formulations"
MECHANICS = {"statics", "kinematics", "tree", "operator"}  # the frame must not share these


def imports(path: Path) -> set[str]:
    """Every module a file imports, dotted."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
    return found


def violations(package: dict[str, set[str]], layers: tuple[set[str], ...]) -> list[str]:
    """Imports of ``seqopt`` modules that go sideways or up, or to a module in no layer."""
    level = {name: i for i, names in enumerate(layers) for name in names}
    out = [f"{name} is in no layer" for name in package if name not in level]
    for name, targets in package.items():
        for target in targets:
            if level.get(target, 99) >= level.get(name, -1):
                out.append(f"{name} imports {target}")
    return out


def seqopt_imports() -> dict[str, set[str]]:
    return {
        path.stem: {
            target.split(".")[1]
            for target in imports(path)
            if target.startswith("seqopt.") and target != f"seqopt.{path.stem}"
        }
        for path in (ROOT / "seqopt").glob("*.py")
    }


def test_imports_follow_the_layers():
    assert violations(seqopt_imports(), LAYERS) == []


def test_an_upward_import_is_seen():
    package = seqopt_imports()
    package["scene"] = package["scene"] | {"operator"}
    assert violations(package, LAYERS) == ["scene imports operator"]


def test_no_cycles():
    graph = nx.DiGraph([(a, b) for a, targets in seqopt_imports().items() for b in targets])
    assert nx.is_directed_acyclic_graph(graph)


@pytest.mark.parametrize("folder", ["seqopt", "formulations", "experiments"])
def test_solvers_stay_at_home(folder):
    for path in (ROOT / folder).rglob("*.py"):
        found = {name.split(".")[0] for name in imports(path)}
        if folder != SOLVER_HOME:
            assert not found & SOLVERS, path
        if folder == "seqopt":
            assert not found & {"formulations", "experiments", "tests"}, path


def test_the_frame_shares_no_mechanics():
    """It may ask rigid bricks whether there is a mechanism; its answers are its own."""
    assert not seqopt_imports()["frame"] & (MECHANICS | {"compliance"})
    source = (ROOT / "seqopt" / "frame.py").read_text(encoding="utf-8")
    assert "from seqopt.rigid import require_resistance\n" in source


def test_modules_stay_small():
    for folder in ("seqopt", "formulations"):
        for path in (ROOT / folder).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            assert len(path.read_text(encoding="utf-8").splitlines()) <= 300, path
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef):
                    assert (node.end_lineno or 0) - node.lineno < 50, f"{path}: {node.name}"
