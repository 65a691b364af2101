"""Mortar that cures, as judges look at it: verdicts of plans, and floors under all waits."""
