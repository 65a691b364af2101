"""Reading and writing instances: an archive that NumPy reads as well, or a program for solvers."""

from __future__ import annotations

import io
import json
import zipfile
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_bytes, write_file
from seqopt._registry import Later
from seqopt.arms._archives import Archive
from seqopt.errors import FileError, ProblemError, plugins
from seqopt.exchange._files import write_folder
from seqopt.graph.graph import Graph, _Target
from seqopt.instances.model import Instance, _by_goal, _Cap
from seqopt.times._archive import STORED, read_acts

jsonschema = Later("jsonschema")  # slow to import, and of files alone

FORMAT, VERSION = "seqopt-instance", 1
WRITTEN = (".npz", ".mps")
TEXT = "instance.json"  # the name of the text in the archive


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
        arrays |= {n: _narrow(getattr(instance.timed, name)) for n, name in STORED.items()}
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


def _read(path: Path) -> Instance:
    """Read the instance of a file; raise a `FileError` that names the fault."""
    if path.suffix == ".mps":
        raise FileError(f"{path}: {path.suffix} is written for solvers, not read; give the .npz")
    content = read_bytes(path)
    try:
        archive = Archive(content, str(path))
        known = {"Infinity": np.inf}.get  # of what JSON does not know
        document = parse_json(archive.text(TEXT), f"{path}: {TEXT}", parse_constant=known)
    except FileError as error:
        raise FileError(f"{error}; it is no instance: write one with seqopt instance") from error
    schema = json.loads(files("seqopt").joinpath("data/instance.schema.json").read_text("utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    wrong = jsonschema.exceptions.best_match(validator.iter_errors(document))
    if wrong is not None:
        where = "/".join(map(str, wrong.absolute_path)) or "the text"
        raise FileError(f"{path}: {TEXT}, {where}: {wrong.message}")
    try:
        return _instance(document, archive)
    except (ProblemError, ValueError) as error:
        raise FileError(f"{path}: {error}") from error


def _instance(document: dict[str, Any], archive: Archive) -> Instance:
    """Return the instance of a valid document and its arrays, after checks of these."""
    columns = document["columns"]
    n, m = (int(document[name]) for name in ("nodes", "arcs"))  # which JSON Schema takes as 5.0
    named = ["source", "target", "ends", "states", *(f"amount_{k}" for k in range(len(columns)))]
    named += ["alone"] if document.get("alone", False) else []
    named += STORED if document["timed"] else []
    archive.require((TEXT, *(f"{name}.npy" for name in named)))
    source, target = (archive.indices(name, (m,), 0, n) for name in ("source", "target"))
    ends = np.isin(np.arange(n), archive.indices("ends", (None,), 0, n))
    states = archive.array("states", "iu", (n, None)).astype(np.int64)
    if not states.shape[1] or (states[source, 0] > states[target, 0]).any():
        raise ValueError("states: begin with levels, to lower ones of which no arc leads")
    names, amounts = tuple(each["name"] for each in columns), np.zeros((m, len(columns)))
    for k, column in enumerate(columns):
        of_nodes = column["of"] == "nodes"
        values = archive.numbers(f"amount_{k}", (n if of_nodes else m,))
        amounts[:, k] = values[target] if of_nodes else values
    goals = tuple(
        _Target(g["name"], g["kind"], tuple(map(int, g["columns"])), g["most"])
        for g in document["goals"]
    )
    whole = ((c["name"], c["column"], c["most"]) for c in document["caps"])
    caps = tuple(_Cap(name, None if k is None else int(k), most) for name, k, most in whole)
    for k in [k for goal in goals for k in goal.columns] + [cap.column or 0 for cap in caps]:
        if k and k >= len(names):
            raise ValueError(f"column {k} is named, and there are {len(names)}")
    timed, rows = None, (source.astype(np.int32), target.astype(np.int32))
    if document["timed"]:
        graph = Graph(*rows, amounts, (False,) * len(names), ends)
        timed = read_acts(archive, _by_goal(graph, (goals, caps)), states[:, 0])
    alone = archive.numbers("alone", (m, 2)) if "alone" in named else None
    more = document["facts"]
    return Instance(
        document["name"], *rows, ends, names, amounts, goals, caps, states, timed, alone, more
    )


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
        return _read(path / "instance.npz")
    built_in = Path(str(files("seqopt").joinpath("data/instances")))
    if not path.exists() and (built_in / f"{path}.npz").is_file():
        return _read(built_in / f"{path}.npz")
    if not path.exists() and path.suffix == "":
        known = ", ".join(sorted(each.stem for each in built_in.glob("*.npz")))
        raise FileError(f"instance {path} does not exist; give a file, or one of {known}")
    return _read(path)


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
    if path.suffix not in ("", *WRITTEN):
        known = ", ".join(WRITTEN)
        raise FileError(
            f"{path}: {path.suffix} is no format of instances; give {known}, or a folder"
        )
    as_mps = plugins("seqopt.programs")["mps"].load()  # a formulation writes the program down
    if path.suffix:
        write_file(path, stored(instance) if path.suffix == ".npz" else as_mps(instance))
        return
    archive = stored(instance)
    text = Archive(archive, str(path)).text(TEXT)
    programs = {} if instance.asks_time else {"instance.mps": as_mps(instance)}
    write_folder(path, {"instance.npz": archive, TEXT: text, **programs})
