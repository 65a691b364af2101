"""What was found: problems solved, answers judged, and the plans that come of it.

A problem says what a step costs (a criterion), which values are allowed (limits) and which choices
there are (a schedule). A formulation solves it. The plan that comes back carries a certificate: its
value and a lower bound, both computed again from the problem's data.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.build import build_network
>>> from seqopt.graph.layers.layers import candidate_layers
>>> from seqopt.plan import solve
>>> from seqopt.problem import Limit, WorstRatio
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.sequence.three_robots import three_robot_loop
>>> network = build_network(load_scene("arch25"))
>>> criterion = WorstRatio("my limits", (("T_max", 90.0), ("M_sup", 22.0)))  # N, N m
>>> engine = make_engine("compliance", network)
>>> problem = candidate_layers(engine, three_robot_loop(network), criterion, [Limit("F_largest", 300.0)])  # N
>>> plan = solve(problem, "overlap_dp")
>>> plan.nodes[:3], plan.certificate.gap
((4, 2, 3), 0.0)
"""

from seqopt.plan.judge.certificate import Certificate
from seqopt.plan.plan import Plan
from seqopt.plan.solving import solve

__all__ = ["Certificate", "Plan", "solve"]
