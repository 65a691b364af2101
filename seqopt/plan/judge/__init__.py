"""Proofs that share nothing with what they judge: values, bounds, infeasibility."""
