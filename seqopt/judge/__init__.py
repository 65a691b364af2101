"""Proofs that share nothing with what they judge: values, bounds, infeasibility.

>>> import seqopt
>>> proof = seqopt.optimize("arch25").certificate
>>> round(proof.objective, 3), round(proof.bound, 3), proof.gap
(657.465, 657.465, 0.0)
"""

from seqopt.judge.certificate import Certificate

__all__ = ["Certificate"]
