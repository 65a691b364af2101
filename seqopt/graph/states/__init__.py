"""The states of a build and the moves between them, of every kind of schedule."""
