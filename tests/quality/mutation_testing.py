"""Tests notice at least 95 % of the changes to code that computes, costs and certifies.

Method: Cosmic Ray changes one operator, number, loop or decorator of a module at a time
(`tests.quality.mutants`), and the tests that are for the module run against it. A
mutant that fails one is killed; one that loops is ended after ten times what the tests take, and
counts as killed. Where a module has more mutants than ``--most``, as many are drawn, by a fixed
seed. Modules that prove are a group of their own (``--only proofs``). A mutant that no test could
kill, since nothing that is promised changes, is named in
`tests.quality.equivalents` with the reason; no other is taken off, and one that is
named there and killed makes the claim fail. Controls, for every module: its own text survives, and
a text with a line that raises is killed.

Of the tools that were alive in 2026 Cosmic Ray (8.7, MIT) was taken, since it also changes what
mutmut (3.8, BSD) leaves alone: constants of a module, properties and decorated functions, which
here are tolerances and the engine's ``solve``; mutatest and mutpy have had no release since 2022.
Its own runner starts a Python per mutant, a second of imports each; ours forks one that has them,
and writes no file (`tests.quality.mutant_trials`).

Inputs: the modules below. Command:
``python -m tests.quality.mutation_testing [--quick] [--again] [--only TEXT] [--most N]``;
``--again`` tries what survived the last run, after tests were added, and with a larger ``--most``
what was not tried. Tests that are written for what survived say nothing of mutants that were not
drawn: for these stands what was killed at first sight. Writes
``mutation_testing.csv`` and ``mutation_survivors.csv`` beside this file; the exit status is 1 if
too many survive.
"""

from __future__ import annotations

import argparse
import sys
import zlib
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.stats import binomtest

if TYPE_CHECKING:
    from tests.quality.mutants import Mutant

RIGID = (
    "engines/test_operator",
    "engines/test_rigid_bricks",
    "validation/test_closed_forms",
    "engines/test_conformance",
)
CHOSEN = ("formulations/test_programs", "formulations/test_degenerate")
STANDING = ("formulations/test_equilibrium", "validation/test_limit_analysis")
PROOFS = {
    "seqopt.judge.arithmetic": ("judge/test_certificate", "judge/test_budget_proof"),
    "seqopt.plan._answers": ("judge/test_certificate", "formulations/test_conformance"),
    "seqopt.judge._bounds": ("judge/test_proofs", "judge/test_budget_proof"),
    "seqopt.judge.certificate": (
        *("judge/test_certificate", "plan/test_plan", "judge/test_proofs"),
        "agreement/test_pair_search",
    ),
    "seqopt.plan._infeasible": ("judge/test_budget_proof", "plan/test_no_choice"),
    "seqopt.graph.paths": ("graph/test_graph", "judge/test_free_proof"),
    "seqopt.judge._proof": (
        *("judge/test_proofs", "judge/test_free_proof", "judge/test_free_judge"),
    ),
    "seqopt.judge._rule_moves": ("judge/test_free_proof", "judge/test_proofs"),
    "seqopt.graph._orders": ("formulations/test_order_search",),
    "seqopt.graph._decision_search": ("agreement/test_pair_search",),
}  # what says that nothing is better, or that there is nothing
MODULES = {
    "seqopt.engines.rigid.compliance": (
        *("engines/test_compliance", "engines/test_operator", "engines/test_rigid_bricks"),
        *("engines/test_loose", "responses/test_finite"),
        "engines/test_growth",
    ),
    "seqopt.engines.rigid._operator": RIGID,
    "seqopt.engines.rigid._grip_equations": RIGID,
    "seqopt.engines.rigid._growth": ("engines/test_operator", "engines/test_growth"),
    "seqopt.graph.decision_costs": (
        "graph/test_costs",
        "plan/test_plan",
        "judge/test_certificate",
        "formulations/test_programs",
    ),
    **PROOFS,
    "seqopt.problem.criteria": (
        *("problem/test_criteria", "problem/test_own_criterion", "problem/test_scales"),
        "graph/test_layers",
    ),
    "formulations.beam": CHOSEN,
    "formulations.cascade": CHOSEN,
    "formulations.contact.limit_analysis": STANDING,
    "formulations.labels": (*CHOSEN, "judge/test_budget_proof"),
    "formulations.on_graph": (*CHOSEN, "formulations/test_conformance"),
    "formulations.path_dp": (*CHOSEN, "formulations/test_conformance"),
    "formulations.flow": (*CHOSEN, "plan/test_flow"),
    "formulations.exhibits": ("formulations/test_whole_program",),
    "formulations.rank_search": CHOSEN,
    "formulations.solvers": (*("formulations/test_whole_program", *STANDING), *CHOSEN),
}
LEAST = 0.95  # of the mutants that are not equivalent
MOST, QUICK_MOST, QUICK = 60, 8, "seqopt.problem.criteria"
BROKEN = "\nraise RuntimeError\n"
CONTROLS = {"as_it_is": "survived", "with_a_broken_line": "killed"}
HOME = Path(__file__).resolve().parent
STORE, SURVIVORS = HOME / "mutation_testing.csv", HOME / "mutation_survivors.csv"
KEY = ["module", "operator", "before", "after"]


def asked(text: str) -> list[str]:
    """Return the modules with a text in their names, or those of proofs."""
    return [*PROOFS] if text == "proofs" else [module for module in MODULES if text in module]


def files(module: str) -> list[str]:
    """Return the test files that are run against a module, the quickest first."""
    return [f"tests/{name}.py" for name in MODULES[module]]


def drawn(module: str, most: int) -> tuple[list[Mutant], int]:
    """Return the mutants of a module to be tried, and how many there are."""
    from tests.quality.mutants import mutants  # noqa: PLC0415  # an extra

    every = list(mutants(module))
    if len(every) <= most:
        return every, len(every)
    chosen = np.random.default_rng(zlib.crc32(module.encode())).choice(
        len(every), most, replace=False
    )
    return [every[i] for i in sorted(chosen)], len(every)


def tried(module: str, chosen: list[Mutant]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return what became of mutants, a row each, and of the controls."""
    from tests.quality.equivalents import reason  # noqa: PLC0415
    from tests.quality.mutant_trials import limit, trial  # noqa: PLC0415
    from tests.quality.mutants import path_of  # noqa: PLC0415

    source, tests = path_of(module).read_text(encoding="utf-8"), files(module)
    seconds = limit(module, source, tests)
    texts = dict(zip(CONTROLS, (source, source + BROKEN), strict=True))
    controls = {name: trial(module, text, tests, seconds) for name, text in texts.items()}
    rows = []
    for mutant in chosen:
        about = {name: getattr(mutant, name) for name in ("line", *KEY)}
        outcome = trial(module, mutant.source, tests, seconds)
        rows.append(about | {"outcome": outcome, "reason": reason(mutant)})
    return pd.DataFrame(rows, columns=["line", *KEY, "outcome", "reason"]), controls


def text_of(module: str) -> str:
    """Return a number for the text of a module: rows of another text are of what it once was."""
    from tests.quality.mutants import path_of  # noqa: PLC0415

    return f"crc32 {zlib.crc32(path_of(module).read_bytes()):08x}"


def counted(rows: pd.DataFrame, mutants: int) -> dict[str, int]:
    """Return how many mutants of a module ended in which way."""
    survived, named = rows["outcome"] == "survived", rows["reason"] != ""
    return {
        "mutants": mutants,
        "tried": len(rows),
        "killed": int((~survived).sum()),
        "of_these_timed_out": int((rows["outcome"] == "timed out").sum()),
        "equivalent": int((survived & named).sum()),
        "survived": int((survived & ~named).sum()),
        "equivalent_but_killed": int((~survived & named).sum()),
    }


def measured(module: str, most: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the row of a module, and what survived."""
    chosen, count = drawn(module, most)
    rows, controls = tried(module, chosen)
    row = {"module": module} | counted(rows, count) | controls
    row |= {"survived_at_first": row["survived"], "text": text_of(module)}
    return pd.DataFrame([row | {"tests": " ".join(MODULES[module])}]), left(rows)


def left(rows: pd.DataFrame) -> pd.DataFrame:
    """Return what survived."""
    return rows[rows["outcome"] == "survived"].drop(columns="outcome")


def stored() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return what is stored of modules and survivors."""
    if not STORE.exists():
        return pd.DataFrame(columns=["module"]), pd.DataFrame(columns=["line", *KEY, "reason"])
    return pd.read_csv(STORE), pd.read_csv(SURVIVORS, keep_default_na=False)


def store(row: pd.DataFrame, survivors: pd.DataFrame) -> None:
    """Put a module's row and survivors in the place of those that are stored."""
    (module,) = row["module"]
    for path, table, new in zip((STORE, SURVIVORS), stored(), (row, survivors), strict=True):
        whole = pd.concat([t for t in (table[table["module"] != module], new) if len(t)])
        order = whole["module"].map([*MODULES].index)
        whole.assign(order=order).sort_values("order", kind="stable").drop(columns="order").to_csv(
            path, index=False
        )


def measured_again(module: str, most: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return a module's row and survivors, what survived and what was not tried being tried."""
    from tests.quality.equivalents import reason  # noqa: PLC0415

    table, before = stored()
    row = table[table["module"] == module].reset_index(drop=True)
    survived = {*before.loc[before["module"] == module, KEY].itertuples(index=False, name=None)}
    drawn_before = drawn(module, int(row.loc[0, "tried"]))[0]
    killed = [m for m in drawn_before if tuple(getattr(m, name) for name in KEY) not in survived]
    if len(drawn_before) - len(killed) != (before["module"] == module).sum():
        raise SystemExit(f"{module} is not what it was; run it without --again")
    more, mutants = drawn(module, most)
    again = [mutant for mutant in drawn_before if mutant not in killed]
    fresh = [mutant for mutant in more if mutant not in drawn_before] if most > MOST else []
    rows, controls = tried(module, again + fresh)
    counts = counted(rows, mutants) | {"tried": len(killed) + len(rows)}
    counts["killed"] += len(killed)
    counts["of_these_timed_out"] += int(row.loc[0, "of_these_timed_out"])
    alike = counted(rows[: len(again)], 0)["equivalent"] - int(row.loc[0, "equivalent"])
    first = int(row.loc[0, "survived_at_first"]) - max(alike, 0)
    counts["survived_at_first"] = first + counted(rows[len(again) :], 0)["survived"]
    counts["equivalent_but_killed"] += sum(reason(mutant) != "" for mutant in killed)
    about = {"text": text_of(module), "tests": " ".join(MODULES[module])}
    return row.assign(**counts, **controls, **about), left(rows)


def share(table: pd.DataFrame) -> float:
    """Return which share of the mutants that were tried and are not equivalent is killed."""
    killed = int(table["killed"].sum())
    return killed / (killed + int(table["survived"].sum()))


def first_look(table: pd.DataFrame) -> tuple[float, float]:
    """Return which share was killed before tests were written for what survived, and at least is.

    The second is of all mutants of the modules, with 95 % confidence: what tests were written for
    says nothing of mutants that were not drawn.
    """
    of = int((table["tried"] - table["equivalent"]).sum())
    killed = of - int(table["survived_at_first"].sum())
    return killed / of, float(binomtest(killed, of).proportion_ci(0.95, "wilson").low)


def holds(table: pd.DataFrame, survivors: pd.DataFrame) -> bool:
    """Return whether enough is killed, nothing is wrongly called equivalent, and controls agree."""
    unnamed = int((survivors["reason"] == "").sum())
    return bool(
        share(table) >= LEAST
        and not table["equivalent_but_killed"].any()
        and unnamed == table["survived"].sum()
        and len(survivors) - unnamed == table["equivalent"].sum()
        and all((table[name] == outcome).all() for name, outcome in CONTROLS.items())
    )


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for flag, default, text in (
        ("--only", "", "modules with this in their names, or proofs; rows of others stay"),
        ("--most", MOST, "how many mutants of a module are tried"),
    ):
        parser.add_argument(flag, type=type(default), default=default, help=text)
    text = f"{QUICK_MOST} mutants of one module, nothing written"
    parser.add_argument("--quick", action="store_true", help=text)
    text = "try what survived the last run, and what --most has beyond it"
    parser.add_argument("--again", action="store_true", help=text)
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    options = parsed(arguments)
    if find_spec("cosmic_ray") is None:
        print('cosmic_ray is not installed: pip install "seqopt[mutation]"')
        return 2
    from tests.quality.mutant_trials import preload  # noqa: PLC0415  # an extra

    preload()
    most = QUICK_MOST if options.quick else options.most
    found = []
    for module in [QUICK] if options.quick else asked(options.only):
        found.append(measured_again(module, most) if options.again else measured(module, most))
        print(found[-1][0].drop(columns="tests").to_string(index=False), flush=True)
        if not options.quick:
            store(*found[-1])
    table, survivors = map(pd.concat, zip(*found, strict=True))
    for row in stored()[0].itertuples():
        if not options.quick and row.text != text_of(row.module):
            print(f"{row.module} has changed since it was measured")
    for row in survivors[survivors["reason"] == ""].itertuples():
        print(f"survives: {row.module}:{row.line}: {row.before}  ->  {row.after}")
    note = f"{share(table):.1%} of {table['tried'].sum()} mutants killed, equivalent ones aside"
    if (table["tried"] < table["mutants"]).any():
        seen, least = first_look(table)
        note += (
            f"; {seen:.1%} at first sight, so of all {table['mutants'].sum()} {least:.1%} or more"
        )
    print(note)
    return int(not holds(table, survivors))


if __name__ == "__main__":
    sys.exit(main())
