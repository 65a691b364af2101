"""Forces that hold structures, or motions in which they fall, sought by our own method."""
