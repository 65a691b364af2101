"""Judges bare answers to instances: lists of numbers, and bounds with what is to prove them."""
