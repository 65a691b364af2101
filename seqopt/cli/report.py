"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.cli.answer import Answer
from seqopt.cli.asked import asked_engine, asked_scene
from seqopt.cli.common_arguments import engine_arguments, form_arguments, group, scene_argument
from seqopt.cli.facts import scene_facts
from seqopt.cli.outputs import keep_apart
from seqopt.files import write_text
from seqopt.network.build import build_network
from seqopt.report.plan_pages import PAGE, folder_page

DESCRIPTION = (
    "Write a page with a step viewer of the plans in a folder: the structure in three dimensions, "
    "who holds what, axial forces, displacements, and responses along the build. It is one file "
    "and needs no network. If the folder has a scene.json, that is the scene."
)
EXAMPLES = ("seqopt report best", "seqopt report my.json plans --out plans.html")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``report``.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    basic = group(command, "what is shown")
    scene_argument(basic)
    basic.add_argument("folder", type=Path, metavar="DIR", help="folder that holds plans as CSV")
    basic.add_argument(
        "--out", type=Path, metavar="FILE", help=f"page to write (default: {PAGE} in DIR)"
    )
    engine_arguments(group(command, "how responses are computed (advanced)"))
    form_arguments(group(command, "what is printed"))


def run(options: argparse.Namespace) -> Answer:
    """Write the page of the plans in a folder.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command.

    Returns
    -------
    Answer
    """
    own = options.folder / "scene.json"
    if own.is_file():  # plans go with the scene that stands beside them
        options.scene = str(own)
    scene = asked_scene(options)
    path = options.folder / PAGE if options.out is None else options.out
    keep_apart(options, path)
    options.tell("analyzing plans and writing the page")
    write_text(path, folder_page(asked_engine(options, build_network(scene)), options.folder))
    return Answer(facts={"scene": scene_facts(scene)}, text=f"written to {path}", written=(path,))
