"""What a command leaves: results that are no input, whole folders, and whether payloads hold."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from seqopt.cli.status import Status
from seqopt.cli.terminal import complain
from seqopt.files import require_apart, write_folder
from seqopt.responses.table import steps_over_payload
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import builtin_scenes


def write_results(options: argparse.Namespace, files: Mapping[str, bytes | str]) -> None:
    """Write the files of a command into its folder, all of them or none.

    Parameters
    ----------
    options : argparse.Namespace
        With the folder, ``out``.
    files : mapping of str to (bytes or str)
        Content by name.

    Raises
    ------
    FileError
        If one cannot be written, or would replace an input.
    """
    require_outputs_apart(options, *(options.out / name for name in files))
    write_folder(options.out, files)


def require_outputs_apart(options: argparse.Namespace, *outputs: Path | None) -> None:
    """Raise an error if two outputs of a command are one file, or one is an input.

    Parameters
    ----------
    options : argparse.Namespace
        With the inputs, ``scene`` and ``plan``.
    *outputs : pathlib.Path or None
        None where nothing is written.

    Raises
    ------
    FileError
        Naming the path.
    """
    inputs = [] if options.scene in builtin_scenes() else [Path(options.scene)]
    if getattr(options, "plan", None) is not None:
        inputs.append(options.plan)
    require_apart([path for path in outputs if path is not None], inputs)


def payloads_hold(options: argparse.Namespace, scene: Scene, *tables: pd.DataFrame) -> Status:
    """Return the status that ``--strict`` asks for, and say which robots exceed their payloads.

    Parameters
    ----------
    options : argparse.Namespace
        With ``strict``.
    scene : Scene
    *tables : pandas.DataFrame
        Responses of steps, from `seqopt.analyze`.

    Returns
    -------
    Status
    """
    over = set().union(*(steps_over_payload(scene, table) for table in tables))
    if not options.strict or not over:
        return Status.DONE
    complain(f"seqopt: payload exceeded: {', '.join(sorted(over))}")
    return Status.DOES_NOT_HOLD
