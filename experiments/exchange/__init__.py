"""Experiments on assemblies that others made."""
