"""Layers of candidates with a copy of their costs for every scenario."""
