"""The command ``next``: the best next move from a state, looked up in a policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from seqopt._cli.answer import Answer
from seqopt._cli.given import read_place
from seqopt._cli.options import Asked, word
from seqopt.errors import StepError
from seqopt.plan._range import NONE_KEEPS
from seqopt.plan.policy import FILE, Policy
from seqopt.responses._tolerance import value_text
from seqopt.responses.table import OUTSIDE
from seqopt.scene.scene_file import load_scene


@dataclass(frozen=True, kw_only=True)
class Next(Asked):
    """Print the best next move from a state of a build, whatever happened before.

    Print also what the rest of the build then takes; looked up in the policy that optimize --policy
    writes.

    Where does the build stand?
    state : PLAN:STEP|STATE|N
        where the build stands: after a step of a plan, in a state of a JSON file, or with so many
        bricks that nobody holds
    policy : DIR
        folder that optimize --policy wrote

    Examples
    --------
    seqopt next free:12 --policy free
    seqopt next state.json --policy free --json
    """

    state: str = word(place=True)
    policy: Path = word()


def run(asked: Next) -> Answer:
    """Print the best next move."""
    scene = load_scene(asked.policy / "scene.json")
    policy = Policy.load(asked.policy / FILE)
    found, place = read_place(scene, asked.state)
    if found != scene or place.site is None:
        raise StepError(f"state {asked.state}: the policy is of another order; plan from there")
    advice = policy.best(place.site)
    facts = {
        "move": str(advice),
        "kind": advice.kind.value if advice.kind else None,
        "robots": advice.robots,
        "nodes": advice.nodes,
        "rest": dict(advice.values),
        "then": advice.site.described(scene),
        "proven": policy.checked,
        "keeps_linear_range": policy.keeps_range,
    }
    values = ", ".join(f"{name} {value_text(name, v)}" for name, v in advice.values.items())
    proof = "the table was not checked"
    if policy.checked:
        proof = f"{policy.checked:,} moves prove that nothing has a lower {policy.goals[0]}"
    outside = [] if policy.keeps_range else [f"{OUTSIDE}: {NONE_KEEPS}"]
    lines = [*outside, str(advice), f"the rest takes: {values}; {proof}"]
    return Answer(facts=facts, text="\n".join(lines))
