"""Names under which environments that were installed before find these programs."""

from formulations.flow import OVERLAP_LP, OVERLAP_MIP

__all__ = ["OVERLAP_LP", "OVERLAP_MIP"]
