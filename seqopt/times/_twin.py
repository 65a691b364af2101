"""What the judge needs to know of makespans: the twin that this room offers."""

from seqopt.judge._twin import Twin
from seqopt.times._counts import least_by_counts
from seqopt.times._goal_proofs import label_bounds
from seqopt.times._instances import claimed_time, path_makespan
from seqopt.times._step_check import makespan_of_steps

makespan = Twin(makespan_of_steps, least_by_counts, label_bounds, path_makespan, claimed_time)
