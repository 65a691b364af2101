"""Experiments: a folder per topic, a file per claim, beside it in ``parts`` what claims rest on.

Each states claim, method, inputs and command; ``python -m experiments`` lists them.
"""
