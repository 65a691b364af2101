"""Scenes, plans and words, changed at random from some that are right."""

import copy
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seqopt.graph.formulation import formulation_names
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step
from tests.builders import running_bond

COMMANDS = ("scene", "analyze", "optimize", "assess", "compare")
QUICK = ("compliance", "frame", "auto")  # hundreds of grip sets in a moment
SHARES = (0.3, 0.3, 0.25, 0.1, 0.05)  # of the commands


def pick(rng: np.random.Generator, things: Sequence[Any]) -> Any:
    """Return one of several things."""
    return things[int(rng.integers(len(things)))]


def _engine(rng: np.random.Generator) -> list[str]:
    """Return an engine for a few grip sets."""
    engine = pick(rng, (*QUICK, "discrete"))
    mortar = ["--mortar", "dry"] if engine in ("auto", "discrete") and rng.random() < 0.3 else []
    return ["--engine", engine, *mortar] if rng.random() < 0.5 else []


def _steps(rng: np.random.Generator, plan: bool) -> list[str]:  # noqa: FBT001  # one of two
    return ["--plan", "plan.csv"] if plan else ["--method", pick(rng, tuple(METHODS))]


def _out(rng: np.random.Generator, name: str) -> list[str]:
    return ["--out", name] if rng.random() < 0.7 else []


def _optimize(rng: np.random.Generator, _: object) -> list[str]:
    schedule = pick(rng, ("three-robot", "modified-sequential"))
    criterion = pick(rng, ("equations-2-3", "worst-ratio", "T_max,M_sup=2", "F_each", "D_max"))
    limit = pick(rng, ([], [], ["--limit", "payload"], ["--limit", "T_max=1e3"]))
    formulation = pick(rng, formulation_names())
    return [
        *("--formulation", formulation, "--schedule", schedule, "--criterion", criterion),
        *(*limit, "--out", "out", "--engine", pick(rng, QUICK)),
    ]


MORE: dict[str, Callable[[np.random.Generator, bool], list[str]]] = {
    "scene": lambda rng, _: ["--export", "out.json"] if rng.random() < 0.5 else [],
    "analyze": lambda rng, plan: [*(*_steps(rng, plan), *_engine(rng), *_out(rng, "out.csv"))],
    "optimize": _optimize,
    "assess": lambda rng, plan: [
        *(*_steps(rng, plan), *_out(rng, "out.csv")),
        *(["--mortar", "dry"] if rng.random() < 0.5 else []),
    ],
    "compare": lambda _, __: [],
}
WRONG_WORDS = (
    *("--out", "--plan", "--limit", "--option", "--criterion", "--export", "--no-proof"),
    *("scene.json", "plan.csv", "out/deep/er", "/dev/null", "/dev/full", "/nowhere/out", ".", ""),
    *("width=0", "width=-3", "width=10000000", "horizon=2", "charge=later", "F_rob1=1", "F_sup=1"),
    *("T_max=nan", "T_max=1e-320", "payload", "1e400", "-1", "\udcff", "\x1b[31m", "x" * 5000),
    *("--friction", "1e-300", "1e300", "--help"),
)


def wrong_words(rng: np.random.Generator, words: tuple[str, ...]) -> tuple[str, ...]:
    out = list(words)
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(out) + 1))
        what = int(rng.integers(3))
        if what == 0 and at < len(out):
            out[at] = pick(rng, WRONG_WORDS)
        elif what == 1 and at < len(out):
            del out[at]
        else:
            out.insert(at, pick(rng, WRONG_WORDS))
        if not out:
            return ("scene",)
    return tuple(out)


ODD_NUMBERS = (
    *(0, -1, 1, 2, 0.5, -0.0, 1e-320, 1e-160, 1e-9, 1e9, 1e30, 1e160, 1e308, 10**20, 10**400),
)
ODD_WORDS = (
    *("", "sup", "max", "move", "[sup]", "a,b", "a=b", "\x1b[2J", "\ud800", "\0", "ä", "x" * 300),
)
ODD_VALUES = (*ODD_NUMBERS, *ODD_WORDS, None, True, [], {}, [1, 2, 3], float("nan"), float("inf"))
NESTED = "[" * 5000 + "]" * 5000
SIGNS = '{}[]",:.-+eE0123456789 \n\t\x00abc\ufeff'


@dataclass(frozen=True)
class Case:
    """A command, and what is in the files that it reads.

    Attributes
    ----------
    kind : str
        What was changed: scene, plan, words or nothing.
    words : tuple of str
        After ``seqopt``; the files are ``scene.json`` and ``plan.csv``, what is written goes to
        ``out`` and names that begin so.
    scene, plan : bytes
    """

    kind: str
    words: tuple[str, ...]
    scene: bytes
    plan: bytes


def seeds() -> list[Scene]:
    """Return the scenes that are changed: small, so that a case takes a moment."""
    shapes = (
        ArchShape(pitch=[1.2, 0.7, 0.2, -0.3, -0.8, -1.2]),
        ArchShape(pitch=[1.0, 0.3, -0.3, -1.0], pattern="V"),
        ArchShape(pitch=[0.9, 0.2, -0.6], closed=False),
        ArchShape(pitch=[1.2]),
    )
    return [*(arch_scene(shape) for shape in shapes), running_bond(2, 2)]


def plan_text(scene: Scene, steps: Sequence[Step]) -> str:
    """Return steps as a plan."""
    head = ["step", "type", "bricks", *(f"{robot.name}_node" for robot in scene.robots)]
    rows = [
        [s.number, s.kind.value, s.bricks, *("" if g is None else g for g in s.grips)]
        for s in steps
    ]
    return "\n".join(",".join(map(str, row)) for row in [head, *rows]) + "\n"


class Mutator:
    """Draws cases; a number of a case says it all."""

    def __init__(self) -> None:
        self._base = []
        for scene in seeds():
            network = build_network(scene)
            steps = METHODS["sequential"](network)
            self._base.append((json.loads(dump_scene(scene)), plan_text(scene, steps)))

    def case(self, number: int) -> Case:
        """Return a case by its number."""
        rng = np.random.default_rng(number)
        document, plan = self._base[rng.integers(len(self._base))]
        kind = str(rng.choice(["scene", "scene", "scene", "plan", "words", "nothing"]))
        known, shares = COMMANDS, SHARES
        if kind == "plan":
            known, shares = ["analyze", "assess"], (0.85, 0.15)
        command = str(rng.choice(known, p=shares))
        words = (command, "scene.json", *MORE[command](rng, kind == "plan"))
        scene = json.dumps(document)
        if kind == "scene":
            scene = _changed_scene(rng, document)
        elif kind == "plan":
            plan = _changed_plan(rng, plan)
        elif kind == "words":
            words = wrong_words(rng, words)
        return Case(kind, words, scene.encode(errors="surrogatepass"), plan.encode())


def write_case(case: Case, folder: Path) -> None:
    """Write the files that a case reads."""
    (folder / "scene.json").write_bytes(case.scene)
    (folder / "plan.csv").write_bytes(case.plan)


# scenes
def _changed_scene(rng: np.random.Generator, document: dict[str, Any]) -> str:
    out = copy.deepcopy(document)
    for _ in range(int(rng.integers(1, 4))):
        pick(rng, CHANGES)(rng, out)
    text = json.dumps(out)
    return _noise(rng, text) if rng.random() < 0.1 else text


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return all entries of a document: what holds them, and the key or index there."""
    if isinstance(value, dict):
        here: list[tuple[Any, Any]] = [(value, key) for key in value]
    else:
        here = [(value, index) for index in range(len(value))]
    inside = [_places(holder[key]) for holder, key in here if isinstance(holder[key], dict | list)]
    return [*here, *(place for part in inside for place in part)]


def _replaced(rng: np.random.Generator, document: dict[str, Any]) -> None:
    holder, key = pick(rng, _places(document))
    holder[key] = pick(rng, ODD_VALUES)


def _scaled(rng: np.random.Generator, document: dict[str, Any]) -> None:
    numbers = [(h, k) for h, k in _places(document) if type(h[k]) is float]
    if numbers:
        holder, key = pick(rng, numbers)
        holder[key] *= pick(rng, (-1, 0, 1.001, 0.999, 10, 1e-3, 1e3, 1e9, 1e-12, 1e150))


def _removed(rng: np.random.Generator, document: dict[str, Any]) -> None:
    holder, key = pick(rng, _places(document))
    del holder[key]


def _doubled(rng: np.random.Generator, document: dict[str, Any]) -> None:
    lists = [(h, k) for h, k in _places(document) if isinstance(h[k], list) and h[k]]
    if lists:
        holder, key = pick(rng, lists)
        holder[key].append(copy.deepcopy(pick(rng, holder[key])))


def _swapped(rng: np.random.Generator, document: dict[str, Any]) -> None:
    places = _places(document)
    (first, i), (second, j) = pick(rng, places), pick(rng, places)
    try:
        first[i], second[j] = copy.deepcopy(second[j]), copy.deepcopy(first[i])
    except (KeyError, IndexError):
        return


def _plausible(rng: np.random.Generator, document: dict[str, Any]) -> None:
    """Change numbers in ways that a scene may have: these get past the first checks."""
    springs = [*_list(document, "joints"), *_list(document, "grounds")]
    bricks, robots = _list(document, "bricks"), _list(document, "robots")
    what = int(rng.integers(6))
    value = pick(rng, ODD_NUMBERS)
    if what == 0 and springs:
        pick(rng, springs)[pick(rng, ("translational_stiffness", "rotational_stiffness"))] = (
            rng.permutation([value, 1e8, 0.0]).tolist() if value != 10**400 else [value] * 3
        )
    elif what == 1 and springs and bricks:
        pick(rng, springs)["position"] = copy.deepcopy(pick(rng, bricks).get("position"))
    elif what == 2 and bricks:
        pick(rng, bricks)[pick(rng, ("density", "position", "dimensions"))] = pick(
            rng, (value, [value] * 3, [0.2, 0.1, 0.05])
        )
    elif what == 3:
        document["gravity"] = [0.0, 0.0, value]
    elif what == 4 and robots:
        pick(rng, robots).update(name=pick(rng, ODD_WORDS), payload=value)
    elif isinstance(document.get("build_order"), list):
        document["build_order"] = rng.permutation(len(document["build_order"]) + 1).tolist()[1:]


def _list(document: dict[str, Any], key: str) -> list[dict[str, Any]]:
    found = document.get(key)
    return [x for x in found if isinstance(x, dict)] if isinstance(found, list) else []


Change = Callable[[np.random.Generator, dict[str, Any]], None]
CHANGES: tuple[Change, ...] = (
    *(_replaced, _scaled, _scaled, _removed, _doubled, _swapped, _plausible, _plausible),
)


def _noise(rng: np.random.Generator, text: str) -> str:
    """Return text with signs lost, added or repeated, or cut off."""
    at = int(rng.integers(len(text)))
    what = int(rng.integers(5))
    if what == 0:
        return text[:at]
    if what == 1:
        return text[:at] + text[at + 1 :]
    if what == 2:
        return text[:at] + pick(rng, SIGNS) + text[at:]
    if what == 3:
        return text[:at] + text[at // 2 :]
    return text[:at] + NESTED + text[at:]


# plans
def _changed_plan(rng: np.random.Generator, plan: str) -> str:
    rows = [line.split(",") for line in plan.strip().split("\n")]
    for _ in range(int(rng.integers(1, 4))):
        row = pick(rng, rows)
        what = int(rng.integers(5))
        if what == 0 and row:
            row[int(rng.integers(len(row)))] = str(pick(rng, ODD_VALUES))
        elif what == 1 and len(rows) > 1:
            rows.remove(row)
        elif what == 2:
            rows.insert(int(rng.integers(len(rows) + 1)), list(row))
        elif what == 3:
            row.append(pick(rng, ("", "1", "step", "rob1_node")))
        else:
            row[-1:] = [str(int(rng.integers(-2, 14)))]
    text = "\n".join(",".join(row) for row in rows) + "\n"
    text = _noise(rng, text) if rng.random() < 0.2 else text
    return text.encode(errors="replace").decode()
