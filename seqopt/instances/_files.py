"""Reading and writing instances: an archive that NumPy reads as well, or a program for solvers."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._archives import Archive
from seqopt._files import parse_json, read_bytes, write_bytes, write_folder
from seqopt.errors import FileError, ProblemError
from seqopt.graph.graph import NOW, Graph, TimedGraph
from seqopt.graph.instance import PEAK, SUM, TAIL, Instance, _by_goal, _Cap, _Target
from seqopt.instances._program import as_mps
from seqopt.scene._checks import short

FORMAT, VERSION = "seqopt-instance", 1
TEXT = "instance.json"  # the name of the text in the archive
WHEN = (1980, 1, 1, 0, 0, 0)  # of every part: the same instance is the same file
TIMED = ("free", "alike", "kinds", "move", "column", "origin", "prepares", "acts", "work")


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
        for name in (*TIMED, "longest"):
            arrays[f"timed_{name}"] = _narrow(getattr(instance.timed, name))
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
    return _archive(arrays, json.dumps(document, indent=1) + "\n")


def _narrow(values: np.ndarray) -> np.ndarray:
    """Return integers in the smallest type that holds them."""
    if values.dtype.kind not in "iu":
        return values
    low, high = values.min(initial=0), values.max(initial=0)
    kinds = (np.int8, np.int16, np.int32)
    fits = (k for k in kinds if np.iinfo(k).min <= low and high <= np.iinfo(k).max)
    return values.astype(next(fits, np.int64))


def _archive(arrays: dict[str, np.ndarray], text: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in arrays.items():
            part = io.BytesIO()
            np.save(part, array, allow_pickle=False)
            archive.writestr(_named(f"{name}.npy"), part.getvalue())
        archive.writestr(_named(TEXT), text)
    return out.getvalue()


def _named(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, WHEN)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.create_system = 3  # the same on every system
    return info


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
    _check(document, path)
    for name in ("nodes", "arcs"):
        document[name] = int(document[name])  # JSON Schema takes 5.0 for a whole number
    for goal in document["goals"]:
        goal["columns"] = [*map(int, goal["columns"])]
    for cap in document["caps"]:
        cap["column"] = None if cap["column"] is None else int(cap["column"])
    try:
        return _instance(document, _arrays(document, archive))
    except (ProblemError, ValueError) as error:
        raise FileError(f"{path}: {error}") from error


def _arrays(document: dict[str, Any], archive: Archive) -> dict[str, np.ndarray]:
    """Return the arrays that a document declares, after checks of shape and type."""
    nodes, arcs, timed = document["nodes"], document["arcs"], document["timed"]
    names = [f"amount_{k}" for k in range(len(document["columns"]))]
    more = [f"timed_{name}" for name in (*TIMED, "longest")] if timed else []
    beside = ("alone",) * document.get("alone", False)
    every = ("source", "target", "ends", "states", *names, *beside, *more)
    archive.require((TEXT, *(f"{name}.npy" for name in every)))
    out = {name: archive.array(name, "iu", (arcs,)) for name in ("source", "target")}
    out["ends"] = archive.array("ends", "iu", (None,))
    out["states"] = archive.array("states", "iu", (nodes, None))
    for name, column in zip(names, document["columns"], strict=True):
        out[name] = archive.array(name, "iuf", (nodes if column["of"] == "nodes" else arcs,))
        if not np.isfinite(out[name]).all():
            raise ValueError(f"{name}: give finite numbers; an arc that nobody may take is none")
    for name in beside:
        out[name] = archive.array(name, "iuf", (arcs, 2)).astype(float)
        if not np.isfinite(out[name]).all():
            raise ValueError(f"{name}: give finite numbers")
    return out | (_timed_arrays(archive, nodes, arcs) if timed else {})


def _timed_arrays(archive: Archive, nodes: int, arcs: int) -> dict[str, np.ndarray]:
    """Return the arrays of acts, after checks of their indices of columns, arcs and kinds."""
    kinds = archive.array("timed_kinds", "iu", (None,))
    c, k = len(kinds), int(kinds.max(initial=-1)) + 1
    move = archive.array("timed_move", "iu", (None,))
    out = {"kinds": kinds, "move": move, "free": archive.array("timed_free", "b", (nodes, c))}
    out["alike"] = archive.array("timed_alike", "b", (nodes, max(c - 1, 0)))
    out["column"] = archive.array("timed_column", "iu", (len(move),))
    out["origin"] = archive.array("timed_origin", "iu", (len(move), c))
    shapes = {"prepares": (arcs,), "acts": (arcs,), "work": (arcs, 1 + k), "longest": (c,)}
    out |= {name: archive.array(f"timed_{name}", "iuf", shape) for name, shape in shapes.items()}
    if {*kinds.tolist()} != {*range(k)} or not k:
        raise ValueError(f"kinds of robots are {short(kinds.tolist())}; count them from 0")
    if not np.array_equal(np.unique(move), np.arange(arcs)) or (np.diff(move) < 0).any():
        raise ValueError("timed_move: give the arcs of acts in order, every arc at least once")
    for name, least, most in (("column", -1, c), ("origin", NOW, c)):
        _require_between(f"timed_{name}", out[name], least, most)
    for name in shapes:
        if not (np.isfinite(out[name]) & (out[name] >= 0)).all():
            raise ValueError(f"timed_{name}: give finite numbers of seconds from 0")
    return {f"timed_{name}": array for name, array in out.items()}


def _require_between(name: str, numbers: np.ndarray, least: int, end: int) -> None:
    """Raise a `ValueError` unless integers are from one bound on and below another."""
    if numbers.size and not least <= int(numbers.min()) <= int(numbers.max()) < end:
        worst = int(numbers.min() if int(numbers.min()) < least else numbers.max())
        raise ValueError(f"{name}: {worst} is not from {least} to {end - 1}")


def _check(document: object, path: Path) -> None:
    """Raise a `FileError` that names the first entry where a document breaks the schema."""
    import jsonschema  # noqa: PLC0415  # slow to import, and needed for files only

    schema = json.loads(files("seqopt").joinpath("data/instance.schema.json").read_text("utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    error = jsonschema.exceptions.best_match(validator.iter_errors(document))
    if error is not None:
        where = "/".join(map(str, error.absolute_path)) or "the text"
        raise FileError(f"{path}: {TEXT}, {where}: {error.message}")


def _instance(document: dict[str, Any], arrays: dict[str, np.ndarray]) -> Instance:
    """Return the instance of a valid document and its arrays."""
    count, names = document["nodes"], tuple(column["name"] for column in document["columns"])
    for name in ("source", "target", "ends"):
        _require_between(name, arrays[name], 0, count)
    ends = np.zeros(count, dtype=bool)
    ends[arrays["ends"]] = True
    amounts = np.zeros((document["arcs"], len(names)))
    for k, column in enumerate(document["columns"]):
        values = arrays[f"amount_{k}"]
        amounts[:, k] = values[arrays["target"]] if column["of"] == "nodes" else values
    goals = tuple(
        _Target(g["name"], g["kind"], tuple(g["columns"]), g["most"]) for g in document["goals"]
    )
    caps = tuple(_Cap(**cap) for cap in document["caps"])
    _require_columns(goals, caps, len(names))
    states = arrays["states"].astype(np.int64)
    rows = arrays["source"].astype(np.int32), arrays["target"].astype(np.int32)
    if not states.shape[1] or (states[rows[0], 0] > states[rows[1], 0]).any():
        raise ValueError("states: begin with levels, to lower ones of which no arc leads")
    timed = None
    if document["timed"]:
        own: list[Any] = [arrays[f"timed_{name}"] for name in (*TIMED, "longest")]
        whole: list[Any] = [
            each.astype(np.int64) if each.dtype.kind in "iu" else each for each in own
        ]
        graph = Graph(*rows, amounts, (False,) * len(names), ends)
        timed = TimedGraph(_by_goal(graph, (goals, caps)), states[:, 0], *whole)
    return Instance(
        document["name"],
        *rows,
        ends,
        tuple(names),
        amounts,
        tuple(goals),
        tuple(caps),
        states=states,
        timed=timed,
        alone=arrays.get("alone"),
        facts=document["facts"],
    )


def _require_columns(goals: Sequence[_Target], caps: Sequence[_Cap], count: int) -> None:
    """Raise a `ValueError` unless goals and caps refer to existing columns, in their number."""
    for which in [c for g in goals for c in g.columns] + [cap.column or 0 for cap in caps]:
        if which and which >= count:
            raise ValueError(f"column {which} is named, and there are {count}")
    for goal in goals:
        if (goal.kind in (SUM, PEAK) and len(goal.columns) != 1) or (
            goal.kind == TAIL and not goal.columns
        ):
            raise ValueError(f"goal {goal.name}: {goal.kind} is of one column, tail of several")
    for cap in caps:
        if not cap.most >= 0:
            raise ValueError(f"cap {cap.name}: {cap.most:g} is no amount; give a number from 0")


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
        programs = {"instance.mps": as_mps(instance), TEXT: text}
        write_folder(path, {"instance.npz": archive, **programs})
        return
    if path.suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise FileError(
            f"{path}: {path.suffix} is no format of instances; give {known}, or a folder"
        )
    write_bytes(path, WRITERS[path.suffix](instance))
