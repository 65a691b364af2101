"""Reading and writing instances: an archive that NumPy reads as well, or a program for solvers."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_bytes, write_file
from seqopt._registry import Later
from seqopt.arms._archives import Archive
from seqopt.errors import FileError, ProblemError
from seqopt.exchange._files import write_folder
from seqopt.graph.graph import PEAK, SUM, TAIL, Graph, _Target
from seqopt.instances._program import as_mps
from seqopt.instances.model import Instance, _by_goal, _Cap
from seqopt.scene._checks import short
from seqopt.times._graph import NOW, TimedGraph

jsonschema = Later("jsonschema")  # slow to import, and of files alone

FORMAT, VERSION = "seqopt-instance", 1
TEXT = "instance.json"  # the name of the text in the archive
TIMED = (
    *("free", "alike", "kinds", "move", "column", "origin", "prepares", "acts", "work", "longest"),
)


def stored(instance: Instance) -> bytes:
    """Return the archive of an instance, bitwise reproducible."""
    arrays: dict[str, np.ndarray] = {
        "source": instance.source,
        "target": instance.target,
        "ends": np.flatnonzero(instance.ends).astype(np.int32),
        "states": _narrow(instance.states),
    }
    columns = []
    for k, name in enumerate(instance.columns):
        values, of_nodes = instance.amounts[:, k], np.zeros(instance.nodes)
        of_nodes[instance.target] = values
        alike = np.array_equal(of_nodes[instance.target], values)  # all arcs to each take it
        arrays[f"amount_{k}"] = of_nodes if alike else values
        columns.append({"name": name, "of": "nodes" if alike else "arcs"})
    if instance.alone is not None:
        arrays["alone"] = instance.alone
    if instance.timed is not None:
        arrays |= {f"timed_{name}": _narrow(getattr(instance.timed, name)) for name in TIMED}
    document = {
        "format": FORMAT,
        "version": VERSION,
        "name": instance.name,
        "nodes": instance.nodes,
        "arcs": instance.arcs,
        "columns": columns,
        "goals": [goal._asdict() for goal in instance.goals],
        "caps": [cap._asdict() for cap in instance.caps],
        "timed": instance.timed is not None,
        "alone": instance.alone is not None,
        "facts": dict(instance.facts),
    }
    parts: dict[str, bytes | str] = {}
    for name, array in arrays.items():
        np.save(part := io.BytesIO(), array, allow_pickle=False)
        parts[f"{name}.npy"] = part.getvalue()
    parts[TEXT] = json.dumps(document, indent=1) + "\n"
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in parts.items():
            about = zipfile.ZipInfo(name)  # of 1980, whenever it is written
            about.create_system = 3  # the same on every system
            archive.writestr(about, content, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _narrow(values: np.ndarray) -> np.ndarray:
    """Return integers in the smallest signed type that holds them."""
    if values.dtype.kind not in "iu":
        return values
    low, high = int(values.min(initial=0)), int(values.max(initial=0))
    return values.astype(np.min_scalar_type(min(low, -1 - high)))


def read(path: Path) -> Instance:
    """Read the instance of a file; raise a `FileError` that names the fault."""
    if path.suffix in WRITERS and path.suffix != ".npz":
        raise FileError(f"{path}: {path.suffix} is written for solvers, not read; give the .npz")
    content = read_bytes(path)
    try:
        archive = Archive(content, str(path))
        document = parse_json(archive.text(TEXT), f"{path}: {TEXT}")
    except FileError as error:
        raise FileError(f"{error}; it is no instance: write one with seqopt instance") from error
    schema = json.loads(files("seqopt").joinpath("data/instance.schema.json").read_text("utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    wrong = jsonschema.exceptions.best_match(validator.iter_errors(document))
    if wrong is not None:
        where = "/".join(map(str, wrong.absolute_path)) or "the text"
        raise FileError(f"{path}: {TEXT}, {where}: {wrong.message}")
    for name in ("nodes", "arcs"):
        document[name] = int(document[name])  # JSON Schema takes 5.0 for a whole number
    try:
        return _instance(document, _arrays(document, archive))
    except (ProblemError, ValueError) as error:
        raise FileError(f"{path}: {error}") from error


def _arrays(document: dict[str, Any], archive: Archive) -> dict[str, np.ndarray]:
    """Return the arrays that a document declares, after checks of shape and type."""
    nodes, arcs, timed = document["nodes"], document["arcs"], document["timed"]
    of = {f"amount_{k}": column["of"] for k, column in enumerate(document["columns"])}
    shapes: dict[str, tuple[int, ...]] = {n: (document[kind],) for n, kind in of.items()}
    shapes |= {"alone": (arcs, 2)} if document.get("alone", False) else {}
    whole = {"source": (arcs,), "target": (arcs,), "ends": (None,), "states": (nodes, None)}
    more = [f"timed_{name}" for name in TIMED] if timed else []
    archive.require((TEXT, *(f"{name}.npy" for name in (*whole, *shapes, *more))))
    out = {name: archive.array(name, "iu", shape) for name, shape in whole.items()}
    for name, shape in shapes.items():
        out[name] = archive.array(name, "iuf", shape).astype(float)
        if not np.isfinite(out[name]).all():
            raise ValueError(f"{name}: give finite numbers; an arc that nobody may take is none")
    for name in ("source", "target", "ends"):
        _require_between(name, out[name], 0, nodes)
    states, source, target = out["states"], out["source"], out["target"]
    if not states.shape[1] or (states[source, 0] > states[target, 0]).any():
        raise ValueError("states: begin with levels, to lower ones of which no arc leads")
    return out | (_timed_arrays(archive, nodes, arcs) if timed else {})


def _timed_arrays(archive: Archive, nodes: int, arcs: int) -> dict[str, np.ndarray]:
    """Return the arrays of acts, after checks of their indices of columns, arcs and kinds."""
    kinds, move = (archive.array(f"timed_{name}", "iu", (None,)) for name in ("kinds", "move"))
    c, k = len(kinds), int(kinds.max(initial=-1)) + 1
    shapes: dict[str, tuple[str, tuple[int, ...]]] = {
        "free": ("b", (nodes, c)),
        "alike": ("b", (nodes, max(c - 1, 0))),
        "column": ("iu", (len(move),)),
        "origin": ("iu", (len(move), c)),
        "prepares": ("iuf", (arcs,)),
        "acts": ("iuf", (arcs,)),
        "work": ("iuf", (arcs, 1 + k)),
        "longest": ("iuf", (c,)),
    }
    out = {name: archive.array(f"timed_{name}", *each) for name, each in shapes.items()}
    if {*kinds.tolist()} != {*range(k)} or not k:
        raise ValueError(f"kinds of robots are {short(kinds.tolist())}; count them from 0")
    if not np.array_equal(np.unique(move), np.arange(arcs)) or (np.diff(move) < 0).any():
        raise ValueError("timed_move: give the arcs of acts in order, every arc at least once")
    _require_between("timed_column", out["column"], -1, c)
    _require_between("timed_origin", out["origin"], NOW, c)
    for name, (letters, _) in shapes.items():
        if "f" in letters and not (np.isfinite(out[name]) & (out[name] >= 0)).all():
            raise ValueError(f"timed_{name}: give finite numbers of seconds from 0")
    return {f"timed_{name}": each for name, each in {**out, "kinds": kinds, "move": move}.items()}


def _require_between(name: str, numbers: np.ndarray, least: int, end: int) -> None:
    """Raise a `ValueError` unless integers are from one bound on and below another."""
    if numbers.size and not least <= int(numbers.min()) <= int(numbers.max()) < end:
        worst = int(numbers.min() if int(numbers.min()) < least else numbers.max())
        raise ValueError(f"{name}: {worst} is not from {least} to {end - 1}")


def _instance(document: dict[str, Any], arrays: dict[str, np.ndarray]) -> Instance:
    """Return the instance of a valid document and its arrays."""
    rows = arrays["source"].astype(np.int32), arrays["target"].astype(np.int32)
    ends = np.isin(np.arange(document["nodes"]), arrays["ends"])
    columns, states = document["columns"], arrays["states"].astype(np.int64)
    names, amounts = tuple(each["name"] for each in columns), np.zeros((len(rows[0]), len(columns)))
    for k, column in enumerate(columns):
        values = arrays[f"amount_{k}"]
        amounts[:, k] = values[rows[1]] if column["of"] == "nodes" else values
    goals = tuple(
        _Target(g["name"], g["kind"], tuple(map(int, g["columns"])), g["most"])
        for g in document["goals"]
    )
    whole = ((c["name"], c["column"], c["most"]) for c in document["caps"])
    caps = tuple(_Cap(name, None if k is None else int(k), most) for name, k, most in whole)
    for k in [k for goal in goals for k in goal.columns] + [cap.column or 0 for cap in caps]:
        if k and k >= len(names):
            raise ValueError(f"column {k} is named, and there are {len(names)}")
    for goal in goals:
        count = len(goal.columns)
        if (goal.kind in (SUM, PEAK) and count != 1) or (goal.kind == TAIL and not count):
            raise ValueError(f"goal {goal.name}: {goal.kind} is of one column, tail of several")
    for cap in caps:
        if not cap.most >= 0:
            raise ValueError(f"cap {cap.name}: {cap.most:g} is no amount; give a number from 0")
    timed = None
    if document["timed"]:
        graph = Graph(*rows, amounts, (False,) * len(names), ends)
        own: list[Any] = [arrays[f"timed_{name}"] for name in TIMED]
        own = [each.astype(np.int64) if each.dtype.kind in "iu" else each for each in own]
        timed = TimedGraph(_by_goal(graph, (goals, caps)), states[:, 0], *own)
    facts: dict[str, Any] = {"states": states, "timed": timed, "facts": document["facts"]}
    facts["alone"] = arrays.get("alone")
    return Instance(document["name"], *rows, ends, names, amounts, goals, caps, **facts)


WRITERS: dict[str, Callable[[Instance], bytes | str]] = {".npz": stored, ".mps": as_mps}


def read_instance(path: Path | str) -> Instance:
    """Return the instance of a file, of which no scene is needed.

    Parameters
    ----------
    path : path
        An archive (``.npz``), as `save_instance` writes it, or a folder with one; or the name of a
        built-in instance, as ``chain-12-way``.

    Returns
    -------
    Instance

    Raises
    ------
    FileError
        If the file cannot be read, or is no instance.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import seqopt
    >>> instance = seqopt.compile_instance(seqopt.optimize("arch25").problem)
    >>> with TemporaryDirectory() as folder:
    ...     seqopt.save_instance(instance, f"{folder}/arch25.npz")
    ...     seqopt.read_instance(f"{folder}/arch25.npz") == instance
    True
    """
    path = Path(path)
    if path.is_dir():
        return read(path / "instance.npz")
    built_in = Path(str(files("seqopt").joinpath("data/instances")))
    if not path.exists() and (built_in / f"{path}.npz").is_file():
        return read(built_in / f"{path}.npz")
    if not path.exists() and path.suffix == "":
        known = ", ".join(sorted(each.stem for each in built_in.glob("*.npz")))
        raise FileError(f"instance {path} does not exist; give a file, or one of {known}")
    return read(path)


def save_instance(instance: Instance, path: Path | str) -> None:
    """Write an instance, in the format that the end of the name says.

    Parameters
    ----------
    instance : Instance
    path : path
        ``.npz`` for the archive that `read_instance` reads; ``.mps`` for a program; a name
        without an end for a folder with both.

    Raises
    ------
    FileError
        If it cannot be written, or there is no such format.

    Examples
    --------
    >>> import tempfile
    >>> import seqopt
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_instance(seqopt.read_instance("chain-12-way"), f"{folder}/chain.mps")
    """
    path = Path(path)
    if path.suffix == "":
        archive = stored(instance)
        text = Archive(archive, str(path)).text(TEXT)
        programs = {} if instance.asks_time else {"instance.mps": as_mps(instance)}
        write_folder(path, {"instance.npz": archive, TEXT: text, **programs})
        return
    if path.suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise FileError(
            f"{path}: {path.suffix} is no format of instances; give {known}, or a folder"
        )
    write_file(path, WRITERS[path.suffix](instance))
