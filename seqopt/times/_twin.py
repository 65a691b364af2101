"""The makespan as an amount of whole builds, with what the judge needs to know of it."""

from seqopt.judge._twin import PathTwin
from seqopt.problem.amounts import Amount
from seqopt.times._counts import least_by_counts
from seqopt.times._goal_proofs import label_bounds
from seqopt.times._instances import claimed_time, path_makespan
from seqopt.times._step_check import makespan_of_steps

TWIN = PathTwin(makespan_of_steps, least_by_counts, label_bounds, path_makespan, claimed_time)
makespan = Amount("makespan", unit="s", twin=TWIN)
