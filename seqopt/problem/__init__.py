"""The problem: criteria, aims and requirements.

A criterion turns the responses of a step into its cost. An amount is what states or moves take, of
which the largest or the sum over a build is to be small, or within a budget. A filter says which
states may be passed: within limits and payloads, by rules, standing. A resource is what depends on
the whole path so far.

>>> from seqopt.problem.criteria import WorstRatio
>>> from seqopt.problem.amounts import parse_goals
>>> WorstRatio("my limits", (("T_max", 90.0), ("M_sup", 22.0))).wanted(1)  # N, N m
('T_max', 'M_sup')
>>> [str(goal) for goal in parse_goals("minmax,steps")]
['minmax', 'steps']
"""

from seqopt.problem.amounts import Amount
from seqopt.problem.criteria import Criterion
from seqopt.problem.requirements import Filter, Limit, Resource, StepArrays, register

__all__ = ["Amount", "Criterion", "Filter", "Limit", "Resource", "StepArrays", "register"]
