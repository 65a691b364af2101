"""Claim: all figures and tables of the paper with numbers have a counterpart; three disagree.

These three are the secant stiffness of a vault test, the calibrated stiffness of all eight, and the
errors against discrete elements. The others agree at least in part: half or more of their values
are within 5 % of print beyond rounding (`experiments.harness.yardstick`).

Method: `ITEMS` lists the paper's figures and tables in order with what has no
numbers; `parts.counterpart_rows` computes every printed value anew.
Which three disagree was seen in the first run; the claim fails if a fourth does, if one of the
three agrees, or if an item has no values.

Inputs: the shipped scene, plan and tables. Command: ``python -m
experiments paper_counterparts [--quick]``; it writes ``docs/counterparts.md`` too.
"""

from dataclasses import dataclass

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import FIGURES, save_table, stored
from experiments.study.parts.counterpart_rows import ours, tabulate

STEPS = "values (T_pct to two edges)"  # what is counted in the tables of all steps


@dataclass(frozen=True)
class Item:
    """A figure or table of the paper."""

    label: str  # as in the source, ``fig:`` or ``table:``
    number: str  # as a reader counts it
    section: str
    shows: str
    also: str = ""  # another experiment that goes deeper, with its folder
    why: str = ""  # the counterpart disagrees, or there are no numbers
    key: str = ""  # a quantity that is told beside the one with the largest error
    counted: str = "values"
    numbers: bool = True  # without any, it needs no counterpart


ITEMS = (
    Item("fig:full_vault", "Figure 1", "3.1", "the finished vault",
         numbers=False, why="photograph"),
    Item("fig:arch_vault", "Figure 2", "3.1", "vault and central arch with dimensions",
         also="calibration.identify_arch25",
         why="Our values are the dimensions of the bricks as identified from the responses."),
    Item("fig:2robot_traditional", "Figure 3", "3.1", "scaffolding on two sides",
         numbers=False, why="sketch"),
    Item("fig:doublecross", "Figure 4", "3.2.1", "the double-cross model",
         numbers=False, why="definition; drawn in `network.png`"),
    Item("table:exp_data", "Table 1", "3.2.2", "eight vault tests: dimensions",
         also="calibration.calibration",
         why="These are inputs. Our values are measured from the modeled joints; r is the rise."),
    Item("fig:arch_test", "Figure 5", "3.2.2", "a vault test in general",
         numbers=False, why="sketch"),
    Item("fig:secant_stiff", "Figure 6", "3.2.2", "load and displacement of test 1, with secants",
         also="calibration.calibration",
         why="Our model is the bed of springs fitted to all eight tests, which meets the measured "
         "secant. The measured curve itself is not in any table."),
    Item("table:model_results", "Table 2", "3.2.2", "measured and calibrated stiffness",
         also="calibration.calibration",
         why="Our model uses another law, fitted to minimize the mean error over these tests. On "
         "tests left out of the fit it is not shown to be closer. The paper's law with its "
         "printed values does not reproduce the paper's column.", key="mean size of e_rel [%]"),
    Item("fig:3dec_image", "Figure 7", "3.2.3", "the discrete-element model",
         numbers=False, why="sketch"),
    Item("fig:3dec_image2", "Figure 8", "3.2.3", "displacements of blocks and of nodes",
         why="The figure draws displacements but prints only how many nodes are compared.",
         counted="node counts (all that is printed)"),
    Item("table:validation_results", "Table 3", "3.2.3", "errors against discrete elements",
         why="The paper does not say how a robot's pads press, and the difference hangs on it. Our "
         "values use the printed stiffness with a robot that holds a node."),
    Item("fig:2rob_methods", "Figure 9", "4", "both two-robot sequences at bricks 17 to 19"),
    Item("table:sequential_twist", "Table 4", "4.1", "the eight twisting steps",
         also="stability.dry_map"),
    Item("fig:sequential_twist", "Figure 10", "4.1", "lever arm; displaced shape at step 35",
         also="figures",
         why="The lever arm is the support moment divided by the robot force after the crown. The "
         "paper's own columns also leave its range of 135 ± 15 mm."),
    Item("table:cantilever_compare", "Table 5", "4.2", "both methods at the twisting steps"),
    Item("fig:2robot_sequence1", "Figure 11", "4.2", "the cantilever method",
         numbers=False, why="photographs"),
    Item("table:2robot_tension", "Table 6", "4.2", "tension of the two-robot methods",
         why="We take steps 1 to 25 as before the crown, and leave out steps 1 to 4 of the "
         "cantilever method."),
    Item("table:2robot_forces", "Table 7", "4.3", "largest robot forces of the two-robot methods"),
    Item("table:optimization1", "Table 8", "5.2.1", "the modified sequential method",
         why="The paper's count of bricks is one less than in its Table A.1 in every row; all "
         "grips agree."),
    Item("table:optimization2", "Table 9", "5.2.2", "the cascade of the three-robot method"),
    Item("fig:fab_loop", "Figure 12", "5.2.2", "the four-step loop", numbers=False, why="sketch"),
    Item("fig:3rob_sequence", "Figure 13", "5.2.2", "one loop, steps 59 to 62",
         also="study.criteria_variants",
         why="The grips are the printed ones. If it were the optimum, O15 would be in first "
         "place."),
    Item("table:optimization_results", "Table 10", "5.3", "largest responses of three methods",
         also="figures",
         why="The printed value is the second largest displacement of the plan, at step 88; "
         "Table B.1 has 27.9 at step 86."),
    Item("table:experimental_data1", "Table A.1", "A", "the sequential method, step by step",
         also="figures",
         why="[Where it disagrees](paper.md#where-it-disagrees) explains the differences.",
         counted=STEPS),
    Item("table:experimental_data2", "Table A.2", "A", "the cantilever method, step by step",
         also="figures",
         why="[Where it disagrees](paper.md#where-it-disagrees) explains the differences.",
         counted=STEPS),
    Item("table:experimental_data3", "Table B.1", "B", "the three-robot plan, step by step",
         also="study.criteria_variants",
         why="Its responses took no part in the identification of the arch. The schedule is the "
         "loop's; its chosen nodes do not follow from the printed equations. "
         "[Where it disagrees](paper.md#where-it-disagrees) explains the differences.",
         counted=STEPS),
)  # fmt: skip


NEAR = 5.0  # percent beyond rounding, relative to the printed size or 1
AGREES, PARTLY, DISAGREES = "agrees", "agrees in part", "disagrees"


def verdict(rows: pd.DataFrame) -> str:
    """Return how an item agrees, by its rows."""
    share = float((rows["error_pct"] <= NEAR).mean())
    return AGREES if share == 1 else PARTLY if share >= 0.5 else DISAGREES


def short(value: float) -> str:
    """Return a number to four digits, without an exponent."""
    return f"{float(f'{value:.4g}'):.10g}"


def beside(row: pd.Series) -> str:
    """Return a printed value and ours, in words."""
    pair = f"printed {short(row['printed'])}, here {short(row['ours'])}"
    return f"{row['quantity']}, {row['at']}: {pair}"


def statement(item: Item, rows: pd.DataFrame) -> str:
    """Return in one sentence how an item agrees."""
    word, error = verdict(rows), rows["error_pct"]
    count = f"{item.number} {word}: {int((error <= NEAR).sum())} of {len(rows)} {item.counted}"
    if error.max() == 0:
        return f"{count} within rounding."
    median = f", median error {float(f'{error.median():.2g}'):.10g} %" if len(rows) > 2 else ""
    worst = rows.iloc[int(error.to_numpy(float).argmax())]
    text = f"{count} within 5 %{median}; largest error in {beside(worst)}"
    if item.counted == STEPS:
        text += f"; of the responses alone {yardstick(rows)}"
    if item.key:
        text += f"; {beside(rows[rows['quantity'] == item.key].iloc[0])}"
    return f"{text}."


def yardstick(rows: pd.DataFrame) -> str:
    """Return median, 90th and 95th percentile of the errors of responses, shares of edges aside."""
    error = rows["error_pct"][rows["quantity"].str.match("F_|M_sup|T_max|D_")]
    shares = error.quantile([0.5, 0.9, 0.95])
    return "median {:.2f} %, 90th percentile {:.2f} %, 95th {:.2f} %".format(*shares)


INTRODUCTION = """\
## Every figure and table

`python -m experiments paper_counterparts` computes every figure and table that has numbers,
and writes this part of the page; all values, beside the printed ones, are in
`experiments/results/paper_counterparts.csv`. The error is the difference beyond rounding, relative
to the printed value or to 1. An item *agrees* if every value is within 5 % of print, *agrees in
part* if at least half of the values are, and *disagrees* otherwise.

"""
CONVENTIONS = """\
In the CSV file a grip is given by its node; -1 means no grip, and 1003 means the optimized grip O3.
Forces of robots and of the support (the first ground end) are compared by magnitude, and `T_pct` to
within two edges. Figures and tables are numbered in the order of the paper's source.

"""


def line(item: Item, table: pd.DataFrame) -> str:
    """Return the row of the page's table for an item."""
    head = f"| {item.number}, section {item.section}: `{item.label}` | {item.shows} |"
    if not item.numbers:
        return f"{head} no: {item.why} | – | – |"
    named = ", ".join(f"`{name}`" for name in ("study.paper_counterparts", item.also) if name)
    rows = table[table["id"] == item.label]
    text = statement(item, rows).removeprefix(f"{item.number} ")
    return f"{head} yes | {named} | {text} |"


def page(table: pd.DataFrame) -> str:
    words = [verdict(table[table["id"] == item.label]) for item in ITEMS if item.numbers]
    total = (
        f"{len(words)} of {len(ITEMS)} have numbers: {words.count(AGREES)} agree, "
        f"{words.count(PARTLY)} agree in part, {words.count(DISAGREES)} disagree.\n"
    )
    head = (
        "| in the paper | shows | numbers | command (`python -m experiments.`) | agreement |\n"
        "|---|---|---|---|---|"
    )
    lines = [line(item, table) for item in ITEMS]
    parts = [INTRODUCTION + total, "\n".join([head, *lines]) + "\n", CONVENTIONS.rstrip() + "\n"]
    notes = [f"- {item.number}: {item.why}" for item in ITEMS if item.numbers and item.why]
    return "\n".join([*parts, *notes]) + "\n"


KNOWN = {"fig:secant_stiff", "table:model_results", "table:validation_results"}
QUICK = {"fig:arch_vault", "table:model_results", "table:2robot_tension", "table:optimization2"}


def faults(items: list[Item], table: pd.DataFrame) -> list[str]:
    out = []
    for item in items:
        rows = table[table["id"] == item.label]
        if rows.empty:
            out.append(f"{item.label} has no counterpart")
        elif (verdict(rows) == DISAGREES) != (item.label in KNOWN):
            out.append(statement(item, rows))
    return out


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    items = [item for item in ITEMS if item.numbers and (not quick or item.label in QUICK)]
    own = ours()
    table = pd.concat([tabulate(item.label, own) for item in items], ignore_index=True)
    for item in items:
        print(statement(item, table[table["id"] == item.label]))
    if options.store:
        save_table(table, "paper_counterparts", CLAIM.digits)
        table = stored("paper_counterparts")  # captions tell what is stored
        (FIGURES.parent / "counterparts.md").write_text(page(table), encoding="utf-8")
    return Finding(dict.fromkeys(faults(items, table), False), tables={"paper_counterparts": table})


CLAIM = Claim(experiment, digits=6, quick="a few items")
