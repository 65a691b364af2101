"""What was found: problems solved, answers judged, and the plans that come of it.

A problem says what a step costs (a criterion), which values are allowed (limits) and which choices
there are (a schedule). A formulation solves it. The plan that comes back carries a certificate: its
value and a lower bound, both computed again from the problem's data.

>>> import seqopt
>>> from seqopt.plan import pose, solve
>>> from seqopt.problem.criteria import WorstRatio
>>> network = seqopt.build_network(seqopt.load_scene("arch25"))
>>> criterion = WorstRatio("my limits", (("T_max", 90.0), ("M_sup", 22.0)))  # N, N m
>>> engine, limits = seqopt.make_engine("compliance", network), [seqopt.Limit("F_largest", 300.0)]
>>> problem = pose(engine, seqopt.three_robot_loop(network), criterion, limits=limits)  # N
>>> plan = solve(problem, "overlap_dp")
>>> plan.nodes[:3], plan.certificate.gap
((4, 2, 3), 0.0)
"""

from seqopt.plan.plan import Plan
from seqopt.plan.solve import pose, solve

__all__ = ["Plan", "pose", "solve"]
