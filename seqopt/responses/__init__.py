"""Responses: the few numbers that describe how a partial structure carries its weight.

An engine gives forces and displacements everywhere; a response is one number of these, such as the
largest tension. `analyze` returns them as a table for given steps, each computed from scratch.
`Evaluation` computes them for all choices in steps with open grips.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.build import build_network
>>> from seqopt.responses import RESPONSES, Evaluation, analyze
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.sequence.methods import three_robot_loop
>>> from seqopt.sequence.methods import sequential
>>> network = build_network(load_scene("arch25"))
>>> engine = make_engine("compliance", network)
>>> table = analyze(engine, sequential(network))
>>> float(table[RESPONSES["T_max"].column].max().round(1))  # N
114.6
>>> schedule = three_robot_loop(network)
>>> evaluation = Evaluation(engine, schedule, lambda bricks: {"T_max"})
>>> evaluation.steps[0].responses["T_max"].round(1)  # N, by candidate of the first move
array([17.6, 17.6])

Worker processes, other machines, or less memory change no result beyond rounding:

>>> from seqopt.responses import Resources
>>> shared = Evaluation(engine, schedule, lambda bricks: {"T_max"}, Resources(max_memory=1e9))
>>> shared.steps[0] == evaluation.steps[0]
True
"""

from seqopt.responses._choices import Evaluation, StepChoices
from seqopt.responses.quantities import RESPONSES, Response, responses_of
from seqopt.responses.resources import Resources
from seqopt.responses.table import analyze

__all__ = [
    "RESPONSES",
    "Evaluation",
    "Resources",
    "Response",
    "StepChoices",
    "analyze",
    "responses_of",
]
