"""Responses: the few numbers that describe how a partial structure carries its weight.

An engine gives forces and displacements everywhere; a response is one number of these, such as the
largest tension. `analyze` returns them as a table for given steps, each computed from scratch.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.network import build_network
>>> from seqopt.responses import RESPONSES, analyze
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.sequence.methods import sequential
>>> network = build_network(load_scene("arch25"))
>>> engine = make_engine("compliance", network)
>>> table = analyze(engine, sequential(network))
>>> float(table[RESPONSES["T_max"].column].max().round(1))  # N
114.6
"""

from seqopt.responses._grip_sets import Resources
from seqopt.responses.quantities import RESPONSES, Response, responses_of
from seqopt.responses.table import analyze

__all__ = ["RESPONSES", "Resources", "Response", "analyze", "responses_of"]
