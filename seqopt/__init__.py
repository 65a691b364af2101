"""Find where each robot should hold a half-built structure, over the whole build.

A scene says what is built, in which order and by which robots. It becomes a network of bars and
springs. An engine computes how every partial structure responds to the robots' grips. A schedule
lists the steps of the build; some of its grips are still open. The problem is to choose them. A
formulation solves the problem, and the plan is the checked answer.

>>> import seqopt
>>> scene = seqopt.load_scene("arch25")
>>> network = seqopt.build_network(scene)
>>> engine = seqopt.make_engine("compliance", network)
>>> schedule = seqopt.three_robot_loop(network)
>>> problem = seqopt.pose(engine, schedule, seqopt.CRITERIA["equations-2-3"])
>>> plan = seqopt.solve(problem, "overlap_dp")
>>> plan.certificate.gap
0.0

`seqopt.optimize` does all of this in one call. Names are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module

_HOMES = {
    "scene.scene": ("Scene",),
    "scene.parts": ("Robot", "Sphere", "Prop"),
    "scene.scene_file": ("load_scene", "save_scene"),
    "scene.arch": ("ArchShape", "arch_scene"),
    "network.network": ("Network",),
    "network.build": ("build_network",),
    "sequence.steps": ("Step", "Site"),
    "sequence.schedule": ("Schedule",),
    "sequence.methods": ("sequential", "cantilever", "three_robot_loop", "modified_sequential"),
    "sequence.schedule_file": ("read_plan", "read_schedule"),
    "engines.interface": ("Engine",),
    "engines.registry": ("make_engine",),
    "responses.table": ("analyze",),
    "study.published": ("CRITERIA",),
    "problem.criteria": ("StepCost",),
    "problem.requirements": ("Limit",),
    "problem.filters": ("register",),
    "problem.problem": ("Problem",),
    "graph.formulation": ("Formulation", "formulations"),
    "sequence.rules": ("FreeRules",),
    "plan.pose": ("pose",),
    "plan.solve": ("solve",),
    "workflow": ("Robust", "Search", "optimize"),
    "scene.scenarios": ("scenarios",),
    "plan.plan": ("Plan",),
    "instances._files": ("read_instance", "save_instance"),
    "instances.compiled": ("compile_instance",),
    "instances.answers": ("judge_instance",),
    "plan.build": ("GivenSequence",),
    "contact.mortar": ("DRY", "EPOXY"),
    "stability.assessment": ("Stability",),
    "stability._steps": ("assess_steps",),
    "doors": ("assess", "compare", "pareto", "replan"),
    "errors": ("SeqoptError",),
}  # in the order in which they are met; type checkers read them in __init__.pyi
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
__all__ = [*_HOME_OF, "__version__"]  # noqa: PLE0604  # they are strings


def __getattr__(name: str) -> object:
    """Load a name of the door when it is first used (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415  # 30 ms that few ask for

        return version("seqopt")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'seqopt' has no attribute {name!r}")
    found: object = getattr(import_module(f"seqopt.{_HOME_OF[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return [*__all__]
