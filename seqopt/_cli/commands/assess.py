"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import asked_scene, asked_steps, scene_facts
from seqopt._cli.options import (
    CSV_OUT,
    STEPS_USAGE,
    declare,
    form_options,
    scene_options,
    steps_options,
)
from seqopt._cli.outputs import keep_apart, put_table
from seqopt._cli.values import asked_mortar
from seqopt.contact.mortar import MORTARS
from seqopt.engines.registry import versions
from seqopt.network.build import build_network
from seqopt.stability.assessment import Verdict, assess_steps, format_verdicts, stability_table

DESCRIPTION = (
    "Prove of every step of a sequence that it stands, or that it does not, as rigid bricks whose "
    "joints may open and slide; say how much bond, friction and robot force it needs, which tilt "
    "it survives, and which brick and joint fail first."
)
USAGE = STEPS_USAGE
EXAMPLES = (
    "seqopt assess arch25 --method cantilever --out stands.csv",
    "seqopt assess arch25 --method sequential --mortar dry",
)


STRENGTH = {
    "--friction F": "coefficient of friction, in place of the mortar's own",
    "--tensile-strength PA": "what a joint holds in tension, Pa, in place of the mortar's own",
    "--cohesion PA": "what a joint holds in shear without any pressure, Pa, in place of the "
    "mortar's own",
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``assess``."""
    basic = command.add_argument_group("what is assessed")
    scene_options(basic)
    steps_options(basic)
    basic.add_argument(
        "--mortar",
        choices=tuple(MORTARS),
        default="epoxy",
        help="what is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa) or nothing "
        "(default: %(default)s)",
    )
    declare(basic, CSV_OUT)
    declare(command.add_argument_group("a mortar of your own (advanced)"), STRENGTH)
    form_options(command)


def run(options: argparse.Namespace) -> Answer:
    """Assess every step of a sequence; the table is written whatever the verdicts."""
    keep_apart(options, options.out)
    scene = asked_scene(options)
    mortar = asked_mortar(options)
    network = build_network(scene)
    steps = asked_steps(options, scene)
    results = assess_steps(network, steps, mortar, options.tell)
    table = stability_table(steps, results)
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
        **put_table(options.out, table, f"{format_verdicts(results)};"),
        failures=(f"seqopt: solver failed: {said}",) if unsure else (),
        status=Status.FAILED if unsure else status,
    )
