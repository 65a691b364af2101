"""Experiments: one file per claim; each states claim, method, inputs and command."""
