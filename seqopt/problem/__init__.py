"""What is asked: what a step costs, what is to be small, and what must hold.

A criterion turns the responses of a step into its cost, a goal adds costs up over a build, a limit
bounds a response in every step, a budget a total, and a demand of standing every state.

>>> from seqopt.problem.criteria import WorstRatio
>>> from seqopt.problem.problem import parse_goals
>>> WorstRatio("my limits", (("T_max", 90.0), ("M_sup", 22.0))).wanted(1)  # N, N m
('T_max', 'M_sup')
>>> [str(goal) for goal in parse_goals("minmax,steps")]
['minmax', 'steps']
"""

from seqopt.problem.requirements import Criterion, Limit

__all__ = ["Criterion", "Limit"]
