"""Searches that compute only what they need, and questions beyond one optimum."""
