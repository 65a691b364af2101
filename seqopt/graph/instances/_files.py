"""Reading and writing instances: an archive, or a program for solvers."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

from seqopt._files import write_bytes, write_folder
from seqopt.errors import FileError
from seqopt.graph.instances._stored import TEXT, read, stored
from seqopt.graph.instances._texts import as_cp_sat, as_lp, as_mps
from seqopt.graph.instances.instance import Instance

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
