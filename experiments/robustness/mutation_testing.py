"""Claim: tests notice at least 95 % of the changes that a tool makes to what carries the numbers.

Stub.
"""

PLACING, CHOOSING, ENGINES = (
    "tests/placement/test_",
    "tests/formulations/test_",
    "tests/engines/test_",
)
RIGID = (
    f"{ENGINES}operator.py",
    f"{ENGINES}rigid_bricks.py",
    "tests/validation/test_closed_forms.py",
    f"{ENGINES}conformance.py",
    f"{ENGINES}planar.py",
)
CHOSEN = (f"{CHOOSING}programs.py", f"{CHOOSING}degenerate.py")
STANDING = (
    "tests/validation/test_limit_analysis.py",
    "tests/validation/test_blocks.py",
    "tests/agreement/test_limit_analysis.py",
    "tests/stability/test_stability.py",
)
MODULES = {
    "seqopt.engines.rigid.compliance": (f"{ENGINES}compliance.py", *RIGID),
    "seqopt.engines.rigid.operator": RIGID,
    "seqopt.engines.rigid.grip_equations": RIGID,
    "seqopt.placement.costs": (f"{PLACING}costs.py", f"{PLACING}certificate.py"),
    "seqopt.placement.certificate": (f"{PLACING}certificate.py",),
    "seqopt.placement.criteria": (f"{PLACING}criteria.py", f"{PLACING}problem.py"),
    "seqopt.placement.ranks": (f"{PLACING}criteria.py", f"{PLACING}problem.py"),
    "seqopt.placement.terms": (f"{PLACING}criteria.py", f"{PLACING}scales.py"),
    "seqopt.placement.flow": (f"{PLACING}flow.py", *CHOSEN),
    "formulations.beam": CHOSEN,
    "formulations.cascade": CHOSEN,
    "formulations.limit_analysis": STANDING,
    "formulations.minimax": CHOSEN,
    "formulations.overlap_dp": CHOSEN,
    "formulations.overlap_lp": (*CHOSEN, f"{CHOOSING}conformance.py"),
    "formulations.overlap_mip": (*CHOSEN, f"{CHOOSING}conformance.py"),
    "formulations.rank_search": CHOSEN,
    "formulations.solvers": (*CHOSEN, *STANDING),
}
