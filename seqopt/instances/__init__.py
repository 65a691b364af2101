"""Compiled graphs that stand alone: read without a scene, written for any solver."""
