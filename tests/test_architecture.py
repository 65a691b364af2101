"""The picture of the design, held against every import; see docs/architecture.md."""

import ast
import re
import subprocess
import sys
from functools import cache
from io import StringIO
from pathlib import Path
from tokenize import COMMENT, DEDENT, ENDMARKER, INDENT, NEWLINE, NL, generate_tokens

import networkx as nx
import pytest

from experiments.harness.claim import modules as claims
from seqopt._cli.registry import COMMANDS
from seqopt._registry import OFFERS, VIEWS

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.xdist_group("architecture")  # one worker reads every file, once

ROOMS = (
    {"arrays", "errors"},
    {"_registry"},
    {"_files", "work"},
    {"scene"},
    {"network"},
    {"sequence", "contact"},
    {"engines", "stability"},
    {"responses"},
    {"problem"},
    {"graph"},
    {"judge"},
    {"plan"},
    {"study"},
    {"arms", "workflow"},
    {"questions"},
    {"exchange", "times"},
    {"instances"},
    {"report"},
    {"_cli"},
    {"__init__", "__main__"},
)  # a room imports from rooms above it in this list only
OUTER = {"arms", "exchange", "times", "instances", "report", "_cli"}  # the inner ones do without
TOP = {"workflow", "questions", "__init__", "__main__"}  # open inner and outer rooms
SOLVERS = {"cvxpy", "clarabel", "highspy"}
SOLVER_HOME = "formulations"
SHARED = {  # what formulations may import
    "formulations.solvers",
    "formulations.on_graph",
    "formulations.cascade",
    "formulations.flow",
    "formulations._search",
    "formulations.times._search",
    "formulations.times._labels",
    "formulations.times._stages",
}
MECHANICS = {"network._mechanics", "engines.rigid"}  # not for the frame
LINES = 450  # of code: no thought is split for a limit; imports, docstrings and comments aside
LINES_OF_A_FUNCTION = 50  # with signature and docstring, but where it documents its parameters
LINES_OF_A_BODY = 46  # without both, of every function
IMPORT = r"(?m)^ *((?:from .*)?\bimport (?:\([^)]*\)|.*))$"  # on one line, or in brackets
NO_CODE = {COMMENT, NL, NEWLINE, INDENT, DEDENT, ENDMARKER}
SAID = (ast.Module, ast.ClassDef, ast.FunctionDef)  # what may have a docstring
DRAWS_ON_ALL = "study"  # the topic that sets every other one beside the paper
MOST_NAMES = 450  # functions and classes without an underscore


def sources(folder: str) -> list[Path]:
    """Return every file of a folder; none would make all checks below pass without a word."""
    found = sorted((ROOT / folder).rglob("*.py"))
    assert len(found) > 5, f"{folder}: {len(found)} files found"
    return found


def dotted(path: Path) -> str:
    """Return the module that a file is."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path: Path) -> frozenset[str]:
    """Return every module a file imports, dotted."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
    return frozenset(found) | {name for name in looked_up(path, "Later") if name != "?"}


@cache
def arrows(folder: str) -> nx.DiGraph:
    found = {dotted(path): imports(path) for path in sources(folder)}
    out = nx.DiGraph()
    out.add_nodes_from(found)
    out.add_edges_from((a, b) for a, targets in found.items() for b in targets if b in found)
    return out


def graph(folder: str) -> nx.DiGraph:
    """Return the imports among the modules of a folder; others may be added to them."""
    return arrows(folder).copy()


def room(module: str) -> str:
    """Return the room of a module, or the module itself where it stands on the ground."""
    return module.split(".")[1] if "." in module else "__init__"


def wrong_arrows(modules: nx.DiGraph) -> list[str]:
    """Return imports between rooms that go sideways or up, and rooms that are in no layer."""
    level = {name: i for i, names in enumerate(ROOMS) for name in names}
    out = [f"{m} is in no layer" for m in modules if room(m) not in level]
    for a, b in modules.edges:
        if room(a) != room(b) and level.get(room(b), 99) >= level.get(room(a), -1):
            out.append(f"{a} imports {b}")
    return out


def is_page(module: str) -> bool:
    """Return whether a module is the page of a package with others; a room may be one alone."""
    files = {*(ROOT / Path(*module.split("."))).glob("**/*.py")}
    return len(files) > 1


def circles(modules: nx.DiGraph) -> list[list[str]]:
    """Return circles of imports, a package's own page of exports aside."""
    return list(nx.simple_cycles(modules.subgraph([m for m in modules if not is_page(m)])))


def test_imports_between_rooms_go_upward_only():
    assert wrong_arrows(graph("seqopt")) == []


def outward(modules: nx.DiGraph) -> list[str]:
    """Return imports of outer rooms in inner ones."""
    inner = [(a, b) for a, b in modules.edges if room(a) not in OUTER | TOP]
    return [f"{a} imports {b}" for a, b in inner if room(b) in OUTER]


def test_inner_rooms_import_no_outer_one():
    assert set().union(*ROOMS) >= OUTER | TOP
    assert outward(graph("seqopt")) == []


def test_an_import_of_an_outer_room_is_seen():
    modules = graph("seqopt")
    modules.add_edge("seqopt.plan.plan", "seqopt.exchange.exports")
    assert outward(modules) == ["seqopt.plan.plan imports seqopt.exchange.exports"]


@cache
def looked_up(path: Path, by: str = "import_module") -> list[str]:
    """Return what a file imports by name as it runs; ``?`` where the name is made as it runs."""
    if by not in path.read_text(encoding="utf-8"):
        return []
    found = []
    for node in ast.walk(parsed(path)):
        called = node.func if isinstance(node, ast.Call) else None
        if by in (getattr(called, "id", ""), getattr(called, "attr", "")):
            name = node.args[0]
            found.append(str(name.value) if isinstance(name, ast.Constant) else "?")
    return found


def hidden_arrows(files: list[Path]) -> list[str]:
    """Return the files that may import a room without an import that the checks above see."""
    out = []
    for path in files:
        names = looked_up(path)
        made = "?" in looked_up(path, "Later")  # others are arrows as any import
        if made or any(name == "?" or name.startswith("seqopt") for name in names):
            out.append(dotted(path))
    return out


def test_rooms_are_looked_up_in_two_places_only():
    """The door opens every room, a page its own; values find what draws them.

    Commands are in their own room, and the start of one puts off libraries of others.
    """
    known = ["_cli.main", "_registry"]
    assert hidden_arrows(sources("seqopt")) == [f"seqopt.{each}" for each in known]
    commands = {str(each.function).partition(":")[0] for each in COMMANDS.values()}
    assert commands <= set(graph("seqopt"))
    offers = {room(home.partition(":")[0]) for home in (*OFFERS.values(), *VIEWS.values())}
    assert offers - {"questions"} <= OUTER  # which plans anew


@pytest.mark.parametrize("call", ["import_module('seqopt.report.draw')", "Later(f'seqopt.{x}')"])
def test_a_hidden_arrow_is_seen(tmp_path, monkeypatch, call):
    path = tmp_path / "seqopt" / "scene" / "any.py"
    path.parent.mkdir(parents=True)
    path.write_text(f"import importlib\n\nimportlib.{call}\n", "utf-8")
    monkeypatch.setattr("tests.test_architecture.ROOT", tmp_path)
    assert hidden_arrows([path]) == ["seqopt.scene.any"]


def test_a_module_that_is_loaded_later_is_an_arrow(tmp_path):
    path = tmp_path / "any.py"
    path.write_text("PAGES = Later('seqopt.report.page')\n", "utf-8")
    assert imports(path) == {"seqopt.report.page"}


def test_an_arrow_against_the_order_is_seen():
    modules = graph("seqopt")
    modules.add_edge("seqopt.scene.scene", "seqopt.engines.rigid._operator")
    modules.add_edge("seqopt.nowhere", "seqopt.scene.scene")
    seen = wrong_arrows(modules)
    assert "seqopt.scene.scene imports seqopt.engines.rigid._operator" in seen
    assert "seqopt.nowhere is in no layer" in seen


@pytest.mark.parametrize("folder", ["seqopt", "formulations", "experiments"])
def test_no_circles(folder):
    assert circles(graph(folder)) == []


def test_a_circle_is_seen():
    modules = graph("seqopt")
    a, b = "seqopt.scene.scene", "seqopt.scene._checks"
    assert (a, b) in modules.edges
    modules.add_edge(b, a)
    assert circles(modules)


def test_a_page_of_exports_opens_its_own_room_only():
    for path in (ROOT / "seqopt").glob("*/**/__init__.py"):
        own, waits = dotted(path), {"seqopt._registry", "typing"}
        foreign = [t for t in imports(path) - waits if not t.startswith((own, "__future__"))]
        assert not is_page(own) or not foreign, own


def public_names(module: str, tree: ast.Module) -> list[str]:
    """Return the functions and classes of a module that others may build on."""
    if any(part[0] == "_" and part[-2:] != "__" for part in module.split(".")):
        return []
    named = [part.name for part in tree.body if isinstance(part, ast.ClassDef | ast.FunctionDef)]
    return [f"{module}.{name}" for name in named if name[0] != "_"]


def test_few_names_are_public():
    one, two = ast.parse("def f(): ...\nx = 1"), ast.parse("class _C: ...")
    assert public_names("a._b", one) == public_names("a.b", two) == []
    assert public_names("a.__main__", one) == ["a.__main__.f"]
    files = [*sources("seqopt"), *sources("formulations")]
    found = [n for path in files for n in public_names(dotted(path), parsed(path))]
    assert 100 < len(found) <= MOST_NAMES, "begin names that no other file needs with _"


def private_imports(page: str) -> list[str]:
    """Return the lines of a page that import something private."""
    lines = re.findall(r"(?m)^ *(?:>>> )?((?:from|import) (?:seqopt|formulations)\b.*)$", page)
    return [line for line in lines if re.search(r"[. ,]_[a-z]", line)]


# its signature has the options of what it chooses by
FORWARDED = ["formulations.on_graph.OnGraph.__call__"]


def open_keywords(module: str, tree: ast.Module) -> list[str]:
    """Return the functions and methods that others may call with keywords of any name."""
    classes = [part for part in tree.body if isinstance(part, ast.ClassDef)]
    owned = [(f"{module}.{each.name}", each.body) for each in classes] + [(module, tree.body)]
    return [
        f"{owner}.{part.name}"
        for owner, body in owned
        for part in body
        if isinstance(part, ast.FunctionDef) and part.args.kwarg
        if not re.search(r"\._(?!_)", f"{owner}.{part.name}")
    ]


def test_every_keyword_of_what_is_public_has_a_name():
    one = ast.parse("class A:\n    def f(self, **k): ...\n    def _g(self, **k): ...")
    assert open_keywords("a.b", one) == ["a.b.A.f"]
    assert open_keywords("a._b", one) == []
    files = [*sources("seqopt"), *sources("formulations")]
    found = [name for path in files for name in open_keywords(dotted(path), parsed(path))]
    assert found == FORWARDED


def test_pages_use_what_is_public():
    assert len(private_imports("from seqopt import _a\n>>> import seqopt.a._b\nimport seqopt")) == 2
    pages = {path: path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}
    assert {path: found for path, page in pages.items() if (found := private_imports(page))} == {}


LOADED = {"FreeRules()": 68, "seqopt.three_robot_loop(engine.network)": 70}  # only ever less
PLAIN_PLAN = """
import sys, seqopt
from seqopt import FreeRules
engine = seqopt.make_engine("auto", seqopt.load_scene("arch25"))
plan = seqopt.solve(seqopt.pose(engine, {moves}, seqopt.CRITERIA["worst-ratio"]))
assert plan.status == "optimal"
print(sum(name.partition(".")[0] in ("seqopt", "formulations") for name in sys.modules))
"""


@pytest.mark.slow
@pytest.mark.parametrize("moves", LOADED)
def test_a_plain_certified_plan_loads_few_modules(moves):
    program = [sys.executable, "-c", PLAIN_PLAN.format(moves=moves)]
    done = subprocess.run(program, cwd=ROOT, check=True, capture_output=True, text=True)
    assert 10 < int(done.stdout) <= LOADED[moves]


@pytest.mark.parametrize("folder", ["seqopt", "formulations", "experiments"])
def test_solvers_stay_at_home(folder):
    for path in sources(folder):
        found = {name.split(".")[0] for name in imports(path)}
        if folder != SOLVER_HOME:
            assert not found & SOLVERS, path
        if folder == "seqopt":
            assert not found & {"formulations", "experiments", "tests"}, path


def test_formulations_import_none_of_each_other():
    arrows = graph("formulations").edges
    assert {b for _, b in arrows} == SHARED


def test_the_frame_shares_no_mechanics():
    """It may ask rigid bricks whether there is a mechanism; its answers are its own."""
    shared = set()
    for node in ast.walk(parsed(ROOT / "seqopt" / "engines" / "frame.py")):
        of = f"{getattr(node, 'module', '')}." if isinstance(node, ast.ImportFrom) else ""
        names = [of + each.name for each in getattr(node, "names", ())]
        shared |= {name for name in names if any(f"seqopt.{part}" in name for part in MECHANICS)}
    assert shared == {"seqopt.engines.rigid._mixed.require_resistance"}


def code_lines(text: str) -> set[int]:
    """Return the lines of a module that are code: no docstring, import, comment or blank one."""
    tree, found = ast.parse(text), set[int]()
    every = (node for node in ast.walk(tree) if isinstance(node, SAID))
    prose = {node.body[0] for node in every if ast.get_docstring(node) is not None}
    for token in generate_tokens(StringIO(text).readline):
        if token.type not in NO_CODE:
            found |= {*range(token.start[0], token.end[0] + 1)}
    for node in ast.walk(tree):
        if node in prose or isinstance(node, ast.Import | ast.ImportFrom):
            found -= {*range(node.lineno, node.end_lineno + 1)}
    return found


@pytest.mark.parametrize("folder", ["seqopt", "formulations", "experiments"])
def test_modules_and_functions_stay_small(folder):
    for path in sources(folder):
        text = path.read_text(encoding="utf-8")
        assert text.count("\n") <= LINES or len(code_lines(text)) <= LINES, path
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.FunctionDef):
                body = node.body[1:] if ast.get_docstring(node) else node.body
                end = node.end_lineno or 0
                assert not body or end - body[0].lineno < LINES_OF_A_BODY, f"{path}: {node.name}"
                if "Parameters\n" not in (ast.get_docstring(node) or ""):
                    assert end - node.lineno < LINES_OF_A_FUNCTION, f"{path}: {node.name}"


def imported_tests(path: Path) -> set[str]:
    """Return the test files that a file imports, or imports from."""
    lines = re.findall(IMPORT, path.read_text(encoding="utf-8"))
    return {name for line in lines for name in re.findall(r"\btest_\w+", line)}


def test_no_test_imports_another_test():
    """What tests share stands beside them: builders, strategies, commands and fixtures."""
    for path in sources("tests"):
        assert not imported_tests(path), path


def test_an_import_of_another_test_is_seen(tmp_path):
    path = tmp_path / "test_any.py"
    line = "from tests.laws import (\n        test_units,\n    )"
    path.write_text(f"from tests.builders import ROOT\n\n\ndef test():\n    {line}\n", "utf-8")
    assert imported_tests(path) == {"test_units"}


def rooms() -> set[str]:
    """Return the rooms of the package: its folders of modules."""
    return {page.parent.name for page in (ROOT / "seqopt").glob("*/__init__.py")}


def untested(names: set[str]) -> set[str]:
    """Return the rooms that no folder of tests mirrors."""
    folders = {name: ROOT / "tests" / name.strip("_") for name in names}
    return {name for name, folder in folders.items() if not list(folder.glob("test_*.py"))}


def test_every_room_has_a_folder_of_tests():
    assert len(rooms()) > 5
    assert untested(rooms()) == set()


def test_a_room_without_tests_is_seen():
    assert untested(rooms() | {"attic"}) == {"attic"}


def topic(module: str) -> str:
    """Return the folder of an experiment's module."""
    return module.split(".")[1]


def crossed(modules: nx.DiGraph, makers: set[str]) -> list[str]:
    """Return imports of claims, and of parts and topics that are none of the importer's."""
    out = []
    for a, b in modules.edges:
        shared = topic(b) in ("harness", topic(a))
        open_to = a == "experiments.__main__" or (topic(a) == DRAWS_ON_ALL and ".parts." in b)
        if b in makers or not (shared or open_to):
            out.append(f"{a} imports {b}")
    return out


def test_claims_stand_apart_from_their_parts():
    """Nothing imports a claim; parts serve their own topic; the harness knows no topic."""
    modules, makers = graph("experiments"), {module for module, _ in claims().values()}
    assert crossed(modules, makers) == []
    for path in sources("experiments"):
        text = ast.get_docstring(parsed(path)) or ""
        assert text.startswith("Claim: ") == (dotted(path) in makers), path


def test_an_experiment_that_reaches_across_is_seen():
    a, b = "experiments.harness.scenes", "experiments.calibration.parts.barrel_vaults"
    modules, makers = graph("experiments"), {module for module, _ in claims().values()}
    modules.add_edge(a, b)
    assert crossed(modules, makers) == [f"{a} imports {b}"]


def named_views(text: str) -> list[str]:
    """Return the functions that show values and are named in a text."""
    names = sorted({home.partition(":")[2] for home in VIEWS.values()})
    return [name for name in names if re.search(rf"\b{name}\b", text)]


def test_values_name_nothing_that_shows_them():
    assert named_views('display("gantt_picture")(self)') == ["gantt_picture"]
    inner = [path for path in sources("seqopt") if room(dotted(path)) not in OUTER | TOP]
    texts = {path.name: path.read_text("utf-8") for path in inner if path.stem != "_registry"}
    words = {"card", "export", "replan"}  # which mean other things, too
    assert {n: found for n, t in texts.items() if (found := {*named_views(t)} - words)} == {}
