"""Builds as films (extra ``plot``)."""
