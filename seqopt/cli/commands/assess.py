"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.outputs import keep_apart
from seqopt.cli.status import Status
from seqopt.cli.words.asked import asked_scene, scene_facts
from seqopt.cli.words.common_arguments import (
    Takes,
    asked_steps,
    form_arguments,
    group,
    scene_argument,
    steps_arguments,
)
from seqopt.cli.words.values import parse_mortar
from seqopt.contact.mortar import MORTARS
from seqopt.engines.registry import versions
from seqopt.files import csv_text, write_csv
from seqopt.network.build import build_network
from seqopt.stability.assessment import Verdict, assess_steps, format_verdicts, stability_table

DESCRIPTION = (
    "Prove of every step of a sequence that it stands, or that it does not, as rigid bricks whose "
    "joints may open and slide; say how much bond, friction and robot force it needs, which tilt "
    "it survives, and which brick and joint fail first."
)
USAGE = (
    "[SCENE] --method NAME [--out FILE] [other options]",
    "[SCENE] --plan FILE [--out FILE] [other options]",
)
EXAMPLES = (
    "seqopt assess arch25 --method cantilever --out stands.csv",
    "seqopt assess arch25 --method sequential --mortar dry",
)


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``assess``."""
    basic = group(command, "what is assessed")
    scene_argument(basic)
    steps_arguments(basic)
    basic.add_argument(
        "--mortar",
        choices=tuple(MORTARS),
        default="epoxy",
        help="what is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa) or nothing "
        "(default: %(default)s)",
    )
    basic.add_argument(
        "--out", type=Path, metavar="FILE", help="CSV file to write (default: standard output)"
    )
    _strength(group(command, "a mortar of your own (advanced)"))
    form_arguments(group(command, "what is printed"))


def _strength(takes: Takes) -> None:
    for name, metavar, text in (
        ("--friction", "F", "coefficient of friction"),
        ("--tensile-strength", "PA", "what a joint holds in tension, Pa"),
        ("--cohesion", "PA", "what a joint holds in shear without any pressure, Pa"),
    ):
        takes.add_argument(name, metavar=metavar, help=f"{text}, in place of the mortar's own")


def run(options: argparse.Namespace) -> Answer:
    """Assess every step of a sequence; the table is written whatever the verdicts.

    ``options``: of the command.
    """
    keep_apart(options, options.out)
    scene = asked_scene(options)
    mortar = parse_mortar(options)
    network = build_network(scene)
    steps = asked_steps(scene, options)
    results = assess_steps(network, steps, mortar, options.tell)
    table = stability_table(steps, results)
    if options.out is not None:
        write_csv(options.out, table)
    verdicts = [result.verdict for result in results]
    unsure = [s.number for s, v in zip(steps, verdicts, strict=True) if v is Verdict.UNDECIDED]
    said = f"steps {', '.join(map(str, unsure))} are undecided; this says nothing about them"
    status = Status.DOES_NOT_HOLD if Verdict.FALLS in verdicts else Status.DONE
    return Answer(
        facts={
            "scene": scene_facts(scene),
            "mortar": asdict(mortar),
            "versions": versions(),
            "verdicts": {verdict.value: verdicts.count(verdict) for verdict in Verdict},
            "steps": table,
        },
        text="" if options.out is None else f"{format_verdicts(results)}; written to {options.out}",
        data=csv_text(table) if options.out is None else "",
        written=() if options.out is None else (options.out,),
        failures=(f"seqopt: solver failed: {said}",) if unsure else (),
        status=Status.FAILED if unsure else status,
    )
