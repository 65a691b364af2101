"""How much load the steps of a build bear: what ``assess --load-factor`` answers."""

from __future__ import annotations

import argparse

import numpy as np

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import asked_scene, asked_steps, scene_facts
from seqopt._cli.outputs import require_out, write_outputs
from seqopt._cli.values import asked_mortar
from seqopt._cli.words.given import plan_name
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.engines.registry import USUAL, make_engine, versions
from seqopt.network.build import build_network
from seqopt.report._failures import load_page
from seqopt.stability._load_factor import format_load_factors, load_factor_table, load_factors

LOADS = {
    "--load-factor": "find the largest multiple of the scene's loads (forces on bricks and wind, "
    "weights as they are) with which every step stands, and how it gives way then; --out is a "
    "folder"
}


def answer_load_factor(options: argparse.Namespace) -> Answer:
    """Answer how much load every step of a sequence bears."""
    scene = asked_scene(options)
    require_out(options)
    network = build_network(scene)
    steps = asked_steps(options, network)
    found = load_factors(network, steps, asked_mortar(options), options.tell)
    table, said = load_factor_table(steps, found), format_load_factors(steps, found)

    def files() -> dict[str, bytes | str]:
        engine = make_engine(USUAL, network, None)
        page = load_page(engine, plan_name(options), steps, found, said)
        return {"load_factors.csv": csv_text(table), PAGE: page}

    written = write_outputs(options, files)
    where = f"; written to {options.out}; {options.out / PAGE} shows how steps give way"
    failing = (table["load_factor"] < 1) | (table["unloaded"] != "stands")
    unsure = table["step"][table["load_factor"].isna() & (table["load_N"] > 0)]
    unproven = f"seqopt: solver failed: steps {', '.join(map(str, unsure))} are not proven"
    status = Status.DOES_NOT_HOLD if np.any(failing) else Status.DONE
    return Answer(
        facts={"scene": scene_facts(scene), "versions": versions(), "steps": table},
        text=said + where if written else "",
        data="" if written else csv_text(table),
        written=written,
        failures=(unproven,) if len(unsure) else (),
        status=Status.FAILED if len(unsure) else status,
    )
