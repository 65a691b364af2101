"""Charts of builds in time: who prepares, acts and holds when."""
