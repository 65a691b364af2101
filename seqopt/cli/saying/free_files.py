"""What commands write of a free schedule."""

from __future__ import annotations

import json
from collections.abc import Mapping

from seqopt.cli.words.asked import scene_file
from seqopt.files import csv_text
from seqopt.plan.free_plan import FreePlan
from seqopt.report.pages import PAGE, plan_page


def free_files(
    plan: FreePlan, summary: Mapping[str, object], name: str, said: str
) -> dict[str, bytes | str]:
    """Return the files of a free schedule by name.

    ``name``: what the plan is called on its page; ``said``: what it is worth, in words. Result
    (dict of str to (bytes or str)).
    """
    table = plan.responses()
    files: dict[str, bytes | str] = {
        "plan.csv": csv_text(table),
        "summary.json": json.dumps(summary, indent=2) + "\n",
    }
    stands: list[str] = []
    if plan.problem.standing is not None:
        verdicts = plan.stability()
        files["stability.csv"] = csv_text(verdicts)
        stands = [str(verdict) for verdict in verdicts["verdict"]]
    files[PAGE] = plan_page(plan.problem.engine, name, table, said, stands)
    return files | scene_file(plan.problem.network.scene)
