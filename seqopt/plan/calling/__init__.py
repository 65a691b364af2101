"""How formulations are found and called, and what several of them are written with."""
