"""Proofs that share nothing with what they judge: values, bounds, infeasibility."""

from seqopt.judge.certificate import Certificate

__all__ = ["Certificate"]
