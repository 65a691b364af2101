"""No degenerate problem tried is answered wrongly, and every refusal gives its reason.

Method: every registered formulation solves small problems whose exact answer enumeration finds:
ties, limits and budgets that bind or cannot be met, badly scaled or malformed costs. What comes
back is one of

- optimal, feasible: certified, and as good as enumeration or worse;
- infeasible: no choice is allowed;
- refused: the input is malformed, or the formulation does not take budgets;
- solver failed: the solver ended without an answer;
- rejected: it answered, and the certificate found the answer wrong. The linear program ends so
  where its flow mixes choices under a budget; its bound stands.

Asked is that nothing is *wrong*: an answer where there is none, a value below the exact one, a
bound above it, a certified value above it where the formulation promises the optimum, "infeasible"
or a refusal without ground, an exception that is none of these; and that whatever is not answered
says why. Where several choices are optimal,
a second table says which was taken.

Inputs: random whole costs (20 draws), and the three-robot loop on an arch of seven bricks. Command:
``python -m tests.quality.degenerate [--draws N] [--small]``; the exit status is 1 if anything
speaks against it.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, formulations
from tests.layered import Costs
from tests.layered import answer as certified
from tests.quality.degenerate_cases import CASES, Case, Size, enumerated

FULL, SMALL = Size(5, 4, 7), Size(3, 3, 6)
DRAWS = 20
CLOSE = 1e-6  # relative: values this close are equal
UNANSWERED = ("infeasible", "refused", "solver failed", "rejected")
MALFORMED = {"one cost NaN", "one cost -inf", "costs 1e308", "budget amount NaN"}


def answer(problem: Costs, formulation: Formulation) -> dict[str, object]:
    """Return what a formulation makes of a problem; see the module's text."""
    row: dict[str, object] = {"value": np.nan, "bound": np.nan, "choice": (), "message": ""}
    try:
        claimed = certified(problem, formulation, proof=False)
    except (InfeasibleError, ProblemError, SolverError) as error:
        names: dict[type, str] = {InfeasibleError: "infeasible", ProblemError: "refused"}
        return row | {"status": names.get(type(error), "solver failed"), "message": str(error)}
    except Exception as error:  # a traceback is what this looks for
        return row | {"status": "wrong", "message": repr(error)}
    row |= {"bound": claimed.bound, "choice": claimed.choice}
    try:
        certificate = certified(problem, formulation).certificate
    except SolverError as error:
        return row | {"status": "rejected", "message": str(error)}
    return row | {"status": "answered", "value": certificate.objective}


def judge(problem: Costs, formulation: Formulation) -> dict[str, object]:
    """Return the answer with its status held against enumeration."""
    best, winners = enumerated(problem, formulation.aim)
    row = answer(problem, formulation) | {"exact": best, "optima": len(winners), "chosen": ""}
    status, value = row["status"], float(str(row["value"]))
    room = CLOSE * abs(best)
    grounds = {
        "infeasible": not winners,
        "refused": bool(problem.budgets) and not formulation.takes_budgets,
        "answered": bool(winners) and value >= best - room,
    }
    if not grounds.get(str(status), status != "wrong"):
        return row | {"status": "wrong"}
    if float(str(row["bound"])) > best + room:
        return row | {"status": "wrong", "message": "bound above the optimum"}
    if status != "answered":
        return row
    if value > best + room:
        promised = formulation.kind is FormulationKind.EXACT or (
            formulation.kind is FormulationKind.BOUND and not problem.budgets
        )
        return row | {"status": "wrong" if promised else "feasible"}
    ends: dict[object, str] = {winners[0]: "first", winners[-1]: "last"}
    chosen = ends.get(row["choice"], "between") if len(winners) > 1 else "only"
    return row | {"status": "optimal", "chosen": chosen}


def outcomes(name: str, case: Case, size: Size, draws: int) -> list[dict[str, object]]:
    """Return what every formulation makes of the draws of a case."""
    rows: list[dict[str, object]] = []
    for seed in range(draws):
        found: dict[str, dict[str, object]]
        try:
            problem = case(size, np.random.default_rng(seed))
            found = {n: judge(problem, f) for n, f in formulations("costs").items()}
        except ProblemError as error:  # before any formulation
            status = "refused" if name in MALFORMED else "wrong"
            found = {n: {"status": status, "message": str(error)} for n in formulations("costs")}
        for formulation, row in found.items():
            rows.append({"case": name, "seed": seed, "formulation": formulation} | row)
    return rows


def summary(statuses: pd.Series) -> str:
    """Return statuses with their counts where there are several."""
    counts = Counter(statuses)
    if len(counts) == 1:
        return str(next(iter(counts)))
    return ", ".join(f"{status} {count}" for status, count in counts.most_common())


def pivot(table: pd.DataFrame, column: str) -> str:
    """Return a column as text, cases by formulations."""
    wide = table.pivot_table(
        values=column, index="case", columns="formulation", aggfunc=summary, sort=False
    )
    return wide.reindex(columns=list(formulations("costs"))).to_string(na_rep="-")


def faults(table: pd.DataFrame) -> list[str]:
    """Return what speaks against the claim: wrong answers, and refusals without a reason."""
    silent = table["status"].isin(UNANSWERED) & (table["message"].fillna("").str.strip() == "")
    return [
        f"{what}: {row.case}, draw {row.seed}, {row.formulation}: {row.message}"
        for what, rows in (("wrong", table["status"] == "wrong"), ("no reason", silent))
        for row in table[rows].itertuples()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draws", type=int, default=DRAWS, help="of every case")
    parser.add_argument("--small", action="store_true", help="smaller problems")
    options = parser.parse_args(arguments)
    size = SMALL if options.small else FULL
    rows = [
        row for name, case in CASES.items() for row in outcomes(name, case, size, options.draws)
    ]
    table = pd.DataFrame(rows)
    print(pivot(table, "status"))
    print("\nwhich of several optima")
    print(pivot(table[table["chosen"].isin(["first", "between", "last"])], "chosen"))
    found = faults(table)
    for fault in found:
        print(f"against it: {fault}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
