"""Steps of a build: what a sequence is, and the methods that make one from a network.

A step places a brick, releases grips or takes a new grip. A sequence is a list of steps, checked in
its scene. A schedule is a sequence in which some grips are still to be chosen.

>>> from seqopt.network.network import build_network
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.sequence import sequential, three_robot_loop
>>> network = build_network(load_scene("arch25"))
>>> steps = sequential(network)  # no grip is open
>>> len(steps), steps[-1].bricks
(49, 25)
>>> schedule = three_robot_loop(network)  # some are: its moves
>>> move = schedule.moves[0]
>>> move.robot, move.step, move.candidates
('rob3', 3, (4, 5))

Loops of two robots and of more are in `seqopt.sequence.methods`.
"""

from seqopt.sequence.methods import cantilever, modified_sequential, sequential, three_robot_loop
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step

__all__ = [
    "Schedule",
    "Step",
    "cantilever",
    "modified_sequential",
    "sequential",
    "three_robot_loop",
]
