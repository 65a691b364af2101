"""Arguments of the free schedule, which several commands share."""

from __future__ import annotations

from seqopt.cli.words.common_arguments import Takes

RULES = (
    "least_grips=N (2; from the second brick on), newest=either|placing|free (where the newest "
    "brick is held), regrips=N|any (between two bricks), placers=NAME,NAME|any, "
    "payload=kept|ignored, ending=held|released|one-by-one (how robots leave the finished "
    "structure), candidates=near:JOINTS|within:METERS|all (as --candidates)"
)


def add_rules(takes: Takes) -> None:
    """Add what a free schedule takes."""
    takes.add_argument(
        "--rule",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"what robots may do: {RULES}; may be repeated",
    )


def add_standing(takes: Takes) -> None:
    """Add what demands that every state stands."""
    takes.add_argument(
        "--stands",
        metavar="MORTAR",
        help="every state must be proven to stand, robots within payload: "
        "dry, epoxy or bond=STRENGTH (Pa)",
    )
    takes.add_argument("--friction", metavar="F", help="with --stands: coefficient of friction")
    takes.add_argument(
        "--tilt", metavar="DEG", help="with --stands: tilt that every state must survive"
    )
