"""Formulations of builds in time: how long a build takes, on the states of a build."""
