"""Options of ``optimize``, as a usage line has them, with their help."""

from __future__ import annotations

from seqopt.graph.formulation import formulation_names
from seqopt.sequence.rules import FREE
from seqopt.sequence.three_robots import SCHEDULES

BUDGET = {
    "--budget BUDGET ...": "cap on a total over the build, with the formulations labels, "
    "lagrangian, overlap_mip and overlap_lp: travel=0.8 (of what the optimum without budgets "
    "travels), travel=3.5m, steps_over:F_largest=250:10 (at most 10 steps over 250 N), "
    "robot_use:rob1=100:5 (at most 5 in which rob1 carries over 100 N); with --aim or --schedule "
    "free: steps=N, regrips=N, travel=3.5m, makespan=600s or sum(RESPONSE)=VALUE"
}
AIM = {
    "--aim NAME,NAME": "what is to be as small as possible, the most important first: minmax (the "
    "worst step), sum, steps, regrips, travel, makespan (time), a response, as T_max, and others; "
    "these are props (how many are needed, at which nodes), bond, friction, tilt, and "
    "sum(RESPONSE); the worst step is by the criterion, by default worst-ratio, and a makespan "
    "needs --durations (default: minmax with --schedule free; with others the total of what their "
    "moves cost); with --order search the best order of the bricks is found too"
}
SEARCH = {
    "--option NAME=VALUE ...": "option of the formulation, as horizon=2 or width=10",
    "--no-proof": "with cascade or rank_search: compute only the responses that the search meets, "
    "about a fifth; how far the choice is from the optimum stays unknown",
    "--lazy": "with an exact formulation: compute only the responses that the proof needs; stopped "
    "before it is done, it leaves its best choice and a bound; with --aim or --schedule free it is "
    "done at any rate",
    "--candidates RULE": "look at fewer nodes per move: near:12 for those at most 12 joints from "
    "the newest bricks, within:1.5 for those at most 1.5 m from them; makes any formulation a "
    "heuristic (free: of grips on bricks that stand; what is proven holds among these)",
}
ROBUST = {
    "--robust AIM": "what is to be as small as possible over all scenarios, in place of "
    "--formulation: worst-peak (the largest cost of any step), worst-total (the largest total), or "
    "cvar=0.9 (the mean total of the worst tenth)",
    "--scenarios N": "how many samples of the scene (default: 30)",
    "--unseen N": "how many other samples, of the next seed, judge the plan (default: none; as "
    "many as there are scenarios double the time)",
    "--seed N": "which samples are drawn (default: 0)",
    "--vary NAME=VALUE ...": "how far samples are from the scene: stiffness=3 (of each joint, by a "
    "factor up to it, up or down), density=0.1 (of each brick, up to this share), position=0.002 "
    "(of each brick and joint, up to so many m); these are the defaults; grips=2 (of grips that "
    "are not rigid, by a factor up to it)",
}
TIME = {
    "--time-limit SECONDS": "limit of the whole command, of choosing, proof and verdicts: the best "
    "choice by then is written with its bound, and what there was no time for is named; with "
    "--no-proof, where choosing and computing are one, the moves that were chosen by then"
}
WORKERS = {
    "--workers N": "processes to share the work among; pays from about ten seconds (default: "
    "%(default)s)"
}
POLICY = {
    "--policy": "write policy.npz too: the best next move from every state that builds reach "
    "(needs --out; seqopt next looks it up)"
}
BASES = {
    "--bases grid|FILE": "with --schedule free: where the bases of arms stand is chosen too, by "
    "the best plan that they allow: among places of a grid around the bricks (grid:METERS for its "
    "spacing), or those of a CSV file with the columns robot, x, y, z, heading_deg"
}
FEWEST = {
    "--props-among NODES": "with --aim props: at which nodes props may be, and what they bear, as "
    "--props; all of them by default, as all:1e6,push"
}
MEMORY = {
    "--cache DIR": "keep answers there and use what is there: a run that was ended goes on",
    "--max-memory SIZE": "what responses and costs may take, as 500MB or 2GB (default: four fifths "
    "of what is free); of a free schedule states and moves, with a bound where it ends",
}
FORMULATION = {
    "--formulation NAME": "which mathematical program chooses: "
    f"{', '.join(formulation_names())} (default: overlap_dp, which is exact and the fastest, "
    "labels with --budget, minimax with --robust worst-peak, scenario_search with other aims over "
    "scenarios; schedule_search with --aim, --stands or --schedule free, makespan_labels where a "
    "makespan counts, order_search with --order search)"
}
SCHEDULE = {
    "--schedule NAME|FILE": f"{FREE}: any robot may release, hold or place next, or a sequence "
    f"with open grips: {', '.join(SCHEDULES)} (of all robots), or a CSV file of steps; open grips "
    "are marked ? in it (default: the loop of three robots, or of two where there is no third)"
}
OF_BUILT = f"--bases goes with --schedule {FREE} and not with --order."
OF_MOVES = (
    f"--rule and --direction go with --schedule {FREE} alone, --keep with --direction take-down "
    "and not with --to."
)
OF_BEST = (
    f"With --aim, --stands, --order search or --schedule {FREE} states of the build are chosen: "
    "--ranked, --among and criteria of ranks do not go with these. --props-among goes with --aim "
    "props alone, and that with neither --bases nor --props."
)
OF_HOLDS = (
    "--friction, --tilt and --curing go with --stands. Budgets on steps, regrips, makespan and "
    f"sums go with --aim or --schedule {FREE}, those on steps_over and robot_use without."
)
OF_SCENARIOS = "--scenarios, --unseen, --seed and --vary go with --robust alone."
OF_PROVING = "--no-proof goes with cascade and rank_search, --lazy with exact formulations."
