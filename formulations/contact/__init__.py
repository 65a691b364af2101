"""Equilibrium of blocks with contact, as the programs that prove which steps stand."""
