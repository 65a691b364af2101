"""The paper's figures and tables in the order of its source, what each shows, and how it agrees.

Nothing else is needed to tell whether all have a counterpart. Photographs,
sketches and definitions have no numbers; plots of data and drawings with dimensions do. Numbers
count the environments of the LaTeX source on arXiv.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

STEPS = "values (T_pct to two edges)"  # what is counted in the tables of all steps


@dataclass(frozen=True)
class Item:
    """A figure or table of the paper."""

    label: str  # as in the source, ``fig:`` or ``table:``
    number: str  # as a reader counts it
    section: str
    shows: str
    picture: str = ""  # name of the counterpart's; empty if the item has no numbers
    also: str = ""  # another experiment that goes deeper, with its folder
    parts: tuple[str, ...] = ()  # labels within it
    why: str = ""  # the counterpart disagrees, or there are no numbers
    key: str = ""  # a quantity that the caption gives beside the one with the largest error
    counted: str = "values"

    @property
    def has_numbers(self) -> bool:
        """Whether the item needs a counterpart."""
        return bool(self.picture)


ITEMS = (
    Item("fig:full_vault", "Figure 1", "3.1", "the finished vault", why="photograph"),
    Item("fig:arch_vault", "Figure 2", "3.1", "vault and central arch with dimensions", "geometry",
         "calibration.identify_arch25",
         why="Our values are the dimensions of the bricks as identified from the responses."),
    Item("fig:2robot_traditional", "Figure 3", "3.1", "scaffolding on two sides", why="sketch"),
    Item("fig:doublecross", "Figure 4", "3.2.1", "the double-cross model",
         why="definition; drawn in `network.png`"),
    Item("table:exp_data", "Table 1", "3.2.2", "eight vault tests: dimensions", "vaults",
         "calibration.calibration",
         why="These are inputs. Our values are measured from the modeled joints; r is the rise."),
    Item("fig:arch_test", "Figure 5", "3.2.2", "a vault test in general", why="sketch"),
    Item("fig:secant_stiff", "Figure 6", "3.2.2", "load and displacement of test 1, with secants",
         "vaults", "calibration.calibration",
         why="Our model is the bed of springs fitted to all eight tests, which meets the measured "
         "secant. The measured curve itself is not in any table."),
    Item("table:model_results", "Table 2", "3.2.2", "measured and calibrated stiffness", "vaults",
         "calibration.calibration",
         why="Our model uses another law, fitted to minimize the mean error over these tests. On "
         "tests left out of the fit it is not shown to be closer. The paper's law with its "
         "printed values does not reproduce the paper's column.", key="mean size of e_rel [%]"),
    Item("fig:3dec_image", "Figure 7", "3.2.3", "the discrete-element model", why="sketch"),
    Item("fig:3dec_image2", "Figure 8", "3.2.3", "displacements of blocks and of nodes", "discrete",
         why="The figure draws displacements but prints only how many nodes are compared.",
         counted="node counts (all that is printed)"),
    Item("table:validation_results", "Table 3", "3.2.3", "errors against discrete elements",
         "discrete",
         why="The paper does not say how a robot's pads press, and the difference hangs on it. Our "
         "values use the printed stiffness with a robot that holds a node."),
    Item("fig:2rob_methods", "Figure 9", "4", "both two-robot sequences at bricks 17 to 19",
         "sequences", parts=("fig:two_robot_methods",)),
    Item("table:sequential_twist", "Table 4", "4.1", "the eight twisting steps", "twisting",
         "stability.dry_map"),
    Item("fig:sequential_twist", "Figure 10", "4.1", "lever arm; displaced shape at step 35",
         "twisting", "figures", ("fig:sequential_twist_offcenter", "fig:sequential_twist_35"),
         why="The lever arm is the support moment divided by the robot force after the crown. The "
         "paper's own columns also leave its range of 135 ± 15 mm."),
    Item("table:cantilever_compare", "Table 5", "4.2", "both methods at the twisting steps",
         "twisting"),
    Item("fig:2robot_sequence1", "Figure 11", "4.2", "the cantilever method", why="photographs"),
    Item("table:2robot_tension", "Table 6", "4.2", "tension of the two-robot methods", "maxima",
         why="We take steps 1 to 25 as before the crown, and leave out steps 1 to 4 of the "
         "cantilever method."),
    Item("table:2robot_forces", "Table 7", "4.3", "largest robot forces of the two-robot methods",
         "maxima"),
    Item("table:optimization1", "Table 8", "5.2.1", "the modified sequential method", "sequences",
         why="The paper's count of bricks is one less than in its Table A.1 in every row; all "
         "grips agree."),
    Item("table:optimization2", "Table 9", "5.2.2", "the cascade of the three-robot method",
         "sequences"),
    Item("fig:fab_loop", "Figure 12", "5.2.2", "the four-step loop", why="sketch"),
    Item("fig:3rob_sequence", "Figure 13", "5.2.2", "one loop, steps 59 to 62", "loop",
         "study.criteria_variants", ("fig:3rob_58", "fig:3rob_59", "fig:3rob_60", "fig:3rob_61"),
         why="The grips are the printed ones. If it were the optimum, O15 would be in first "
         "place."),
    Item("table:optimization_results", "Table 10", "5.3", "largest responses of three methods",
         "maxima", "figures",
         why="The printed value is the second largest displacement of the plan, at step 88; "
         "Table B.1 has 27.9 at step 86."),
    Item("table:experimental_data1", "Table A.1", "A", "the sequential method, step by step",
         "sequential", "figures",
         why="[Where it disagrees](#where-it-disagrees) explains the differences.",
         counted=STEPS),
    Item("table:experimental_data2", "Table A.2", "A", "the cantilever method, step by step",
         "cantilever", "figures",
         why="[Where it disagrees](#where-it-disagrees) explains the differences.",
         counted=STEPS),
    Item("table:experimental_data3", "Table B.1", "B", "the three-robot plan, step by step",
         "plan", "study.criteria_variants",
         why="Its responses took no part in the identification of the arch. The schedule is the "
         "loop's; its chosen nodes do not follow from the printed equations. "
         "[Where it disagrees](#where-it-disagrees) explains the differences.",
         counted=STEPS),
)  # fmt: skip


NEAR = 5.0  # percent beyond rounding, relative to the printed size or 1
AGREES, PARTLY, DISAGREES = "agrees", "agrees in part", "disagrees"
TITLES = {
    "geometry": "The arch, with its span and height",
    "vaults": "Vault tests: outlines, secants of test 1, stiffness",
    "discrete": "Displacements of the double-cross model and of discrete elements",
    "sequences": "Grips of the methods, step by step",
    "twisting": "The twisting steps",
    "maxima": "Largest and average responses",
    "loop": "Steps 59 to 62 of the three-robot plan",
    "sequential": "Responses of the sequential method",
    "cantilever": "Responses of the cantilever method",
    "plan": "Grips and responses of the published three-robot plan",
}


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


def stated(item: Item, table: pd.DataFrame) -> str:
    """Return `statement` of an item from the rows of all."""
    return statement(item, table[table["id"] == item.label])


def yardstick(rows: pd.DataFrame) -> str:
    """Return median, 90th and 95th percentile of the errors of responses, shares of edges aside."""
    error = rows["error_pct"][rows["quantity"].str.match("F_|M_sup|T_max|D_")]
    shares = error.quantile([0.5, 0.9, 0.95])
    return "median {:.2f} %, 90th percentile {:.2f} %, 95th {:.2f} %".format(*shares)


def caption(picture: str, table: pd.DataFrame) -> str:
    """Return what a picture says of its items."""
    return " ".join(stated(item, table) for item in ITEMS if item.picture == picture)
