"""seqopt."""
