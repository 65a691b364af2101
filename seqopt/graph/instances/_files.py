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

from seqopt._files import read_bytes, write_bytes, write_folder
from seqopt.errors import FileError
from seqopt.graph._timed import TimedGraph
from seqopt.graph.graph import Graph
from seqopt.graph.instances._texts import as_cp_sat, as_lp, as_mps
from seqopt.graph.instances.instance import Instance, _by_goal, _Cap, _Target

FORMAT, VERSION = "seqopt-instance", 1
TEXT = "instance.json"  # the name of the text in the archive
WHEN = (1980, 1, 1, 0, 0, 0)  # of every part: the same instance is the same file
TIMED = ("free", "alike", "kinds", "move", "column", "origin", "prepares", "acts", "work")


def stored(instance: Instance) -> bytes:
    """Return the archive of an instance; the same instance gives the same bytes."""
    arrays: dict[str, np.ndarray] = {
        "source": instance.source,
        "target": instance.target,
        "ends": np.flatnonzero(instance.ends).astype(np.int32),
        "states": _narrow(instance.states),
    }
    columns = []
    for k, name in enumerate(instance.columns):
        of, values = _column(instance, instance.amounts[:, k])
        arrays[f"amount_{k}"] = values
        columns.append({"name": name, "of": of})
    if instance.timed is not None:
        for name in (*TIMED, "longest"):
            arrays[f"timed_{name}"] = _narrow(getattr(instance.timed, name))
    document = _document(instance, columns)
    return _archive(arrays, json.dumps(document, indent=1) + "\n")


def _column(instance: Instance, values: np.ndarray) -> tuple[str, np.ndarray]:
    """Return whether a column is one of nodes, what all arcs to each take, and its values."""
    of_nodes = np.zeros(instance.nodes)
    of_nodes[instance.target] = values
    if np.array_equal(of_nodes[instance.target], values):
        return "nodes", of_nodes
    return "arcs", values


def _document(instance: Instance, columns: list[dict[str, str]]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": instance.name,
        "nodes": instance.nodes,
        "arcs": instance.arcs,
        "columns": columns,
        "goals": [goal._asdict() for goal in instance.goals],
        "caps": [cap._asdict() for cap in instance.caps],
        "timed": instance.timed is not None,
        "facts": dict(instance.facts),
    }


def _narrow(values: np.ndarray) -> np.ndarray:
    """Return whole numbers in as few bytes as hold them."""
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
    """Return the instance of a file; a `FileError` says what is wrong with it."""
    content = read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            document = json.loads(archive.read(TEXT))
            arrays = {
                Path(name).stem: np.load(io.BytesIO(archive.read(name)), allow_pickle=False)
                for name in archive.namelist()
                if name.endswith(".npy")
            }
    except (zipfile.BadZipFile, KeyError, ValueError, EOFError) as error:
        why = f"it is no instance ({error}); write one with seqopt instance"
        raise FileError(f"{path}: {why}") from error
    _check(document, path)
    try:
        return _instance(document, arrays)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise FileError(f"{path}: {_said(error)}") from error


def _said(error: Exception) -> str:
    missing = isinstance(error, KeyError)
    return f"it has no array {error}; write it again" if missing else str(error)


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
    """Return the instance of a document that obeys the schema, and its arrays."""
    count = document["nodes"]
    ends = np.zeros(count, dtype=bool)
    ends[arrays["ends"]] = True
    amounts = np.zeros((document["arcs"], len(document["columns"])))
    for k, column in enumerate(document["columns"]):
        values = arrays[f"amount_{k}"]
        amounts[:, k] = values[arrays["target"]] if column["of"] == "nodes" else values
    goals = tuple(
        _Target(g["name"], g["kind"], tuple(g["columns"]), g["most"]) for g in document["goals"]
    )
    states = arrays["states"].astype(np.int64)
    if len(states) != count:
        raise ValueError(f"{len(states)} states for {count} nodes; give one for each")
    names = tuple(column["name"] for column in document["columns"])
    caps = tuple(_Cap(**cap) for cap in document["caps"])
    for which in [c for goal in goals for c in goal.columns] + [cap.column or 0 for cap in caps]:
        if which and which >= len(names):
            raise ValueError(f"column {which} is named, and there are {len(names)}")
    rows = arrays["source"].astype(np.int32), arrays["target"].astype(np.int32)
    timed = None
    if document["timed"]:
        own: list[Any] = [arrays[f"timed_{name}"] for name in (*TIMED, "longest")]
        whole: list[Any] = [
            each.astype(np.int64) if each.dtype.kind in "iu" else each for each in own
        ]
        graph = Graph(*rows, amounts, (False,) * len(names), ends)
        timed = TimedGraph(_by_goal(graph, (goals, caps)), states[:, 0], *whole)
    made: Any = (goals, caps, states, timed, document["facts"])
    return Instance(document["name"], *rows, ends, names, amounts, *made)


WRITERS: dict[str, Callable[[Instance], bytes | str]] = {
    ".npz": stored,
    ".mps": as_mps,
    ".lp": as_lp,
    ".pbtxt": as_cp_sat,
}


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
        ``.npz`` for the archive that `read_instance` reads; ``.mps``, ``.lp`` or ``.pbtxt``
        (CP-SAT) for a program; a name without an end for a folder with all of them.

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
        write_folder(path, _all(instance))
        return
    if path.suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise FileError(
            f"{path}: {path.suffix} is no format of instances; give {known}, or a folder"
        )
    write_bytes(path, WRITERS[path.suffix](instance))


def _all(instance: Instance) -> dict[str, bytes | str]:
    """Return an instance in all formats by file name; CP-SAT's where times are asked."""
    names = {f"instance{end}": write for end, write in WRITERS.items()}
    if not instance.asks_time:
        del names["instance.pbtxt"]
    out: dict[str, bytes | str] = {name: write(instance) for name, write in names.items()}
    archive = out["instance.npz"]
    assert isinstance(archive, bytes)  # it is the one that is no text
    with zipfile.ZipFile(io.BytesIO(archive)) as parts:
        return {**out, TEXT: parts.read(TEXT).decode()}
