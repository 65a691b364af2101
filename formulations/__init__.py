"""Mathematical programs over a problem of seqopt: one file each, none imports another.

A formulation takes the problem as one frozen value and returns a selection, a grip per move; its
module docstring displays the program that it solves. The package is empty until the problem exists.
"""
