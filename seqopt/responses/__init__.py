"""Responses: the few numbers that say how a partial structure bears its weight and its grips.

An engine gives forces and displacements everywhere; a response is one number of these, such as the
largest tension. Responses come as a table of given steps, each from scratch or with what the steps
before it lock in (`analyze_staged`), or over all choices of steps with open grips.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.build import build_network
>>> from seqopt.responses import RESPONSES, Evaluation, analyze
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.sequence.three_robots import three_robot_loop
>>> from seqopt.sequence.two_robots import sequential
>>> network = build_network(load_scene("arch25"))
>>> engine = make_engine("compliance", network)
>>> table = analyze(engine, sequential(network))
>>> float(table[RESPONSES["T_max"].column].max().round(1))  # N
114.6
>>> schedule = three_robot_loop(network)
>>> evaluation = Evaluation(engine, schedule, lambda bricks: {"T_max"})
>>> evaluation.steps[0].responses["T_max"].round(1)  # N, by candidate of the first move
array([17.6, 17.6])

More processes, other machines, or a folder of answers change no result, to the last bit:

>>> from seqopt.responses import Resources
>>> shared = Evaluation(engine, schedule, lambda bricks: {"T_max"}, Resources(max_memory=1e9))
>>> shared.steps[0] == evaluation.steps[0]
True
"""

from seqopt.responses.choices import Evaluation, StepChoices
from seqopt.responses.quantities import RESPONSES, Response, responses_of
from seqopt.responses.resources import Resources
from seqopt.responses.staged import analyze_staged
from seqopt.responses.table import analyze

__all__ = [
    "RESPONSES",
    "Evaluation",
    "Resources",
    "Response",
    "StepChoices",
    "analyze",
    "analyze_staged",
    "responses_of",
]
