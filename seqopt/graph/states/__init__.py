"""The states of a build and the moves between them, whatever the schedule."""
