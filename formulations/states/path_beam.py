"""The name under which environments that were installed before find this beam."""

from formulations.beam import PATH_BEAM as FORMULATION

__all__ = ["FORMULATION"]
