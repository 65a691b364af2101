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
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from seqopt.contact.mortar import DRY, EPOXY
    from seqopt.engines.interface import Engine
    from seqopt.engines.registry import make_engine
    from seqopt.errors import SeqoptError
    from seqopt.network.build import build_network
    from seqopt.network.network import Network
    from seqopt.plan.build import GivenSequence
    from seqopt.plan.calling.formulation import Formulation, formulations
    from seqopt.plan.judge.certificate import Certificate
    from seqopt.plan.plan import Plan
    from seqopt.plan.solving import pose, solve
    from seqopt.problem.criteria import StepCost
    from seqopt.problem.problem import Problem
    from seqopt.problem.requirements import Limit
    from seqopt.responses.table import analyze
    from seqopt.scene.arch import ArchShape, arch_scene
    from seqopt.scene.parts import Robot, Sphere
    from seqopt.scene.scenarios import scenarios
    from seqopt.scene.scene import Scene
    from seqopt.scene.scene_file import load_scene, save_scene
    from seqopt.sequence.free_rules import FreeRules
    from seqopt.sequence.schedule import Schedule
    from seqopt.sequence.schedule_file import read_plan, read_schedule
    from seqopt.sequence.steps import Step
    from seqopt.sequence.three_robots import modified_sequential, three_robot_loop
    from seqopt.sequence.two_robots import cantilever, sequential
    from seqopt.stability.assessment import Stability, assess_steps
    from seqopt.study.published import CRITERIA
    from seqopt.workflow import optimize

_HOMES = {
    "contact.mortar": ("DRY", "EPOXY"),
    "engines.interface": ("Engine",),
    "engines.registry": ("make_engine",),
    "errors": ("SeqoptError",),
    "network.build": ("build_network",),
    "network.network": ("Network",),
    "plan.calling.formulation": ("Formulation", "formulations"),
    "plan.build": ("GivenSequence",),
    "plan.judge.certificate": ("Certificate",),
    "plan.plan": ("Plan",),
    "plan.solving": ("pose", "solve"),
    "problem.criteria": ("StepCost",),
    "problem.problem": ("Problem",),
    "problem.requirements": ("Limit",),
    "responses.table": ("analyze",),
    "scene.arch": ("ArchShape", "arch_scene"),
    "scene.parts": ("Robot", "Sphere"),
    "scene.scenarios": ("scenarios",),
    "scene.scene": ("Scene",),
    "scene.scene_file": ("load_scene", "save_scene"),
    "sequence.free_rules": ("FreeRules",),
    "sequence.schedule": ("Schedule",),
    "sequence.schedule_file": ("read_plan", "read_schedule"),
    "sequence.steps": ("Step",),
    "sequence.three_robots": ("modified_sequential", "three_robot_loop"),
    "sequence.two_robots": ("cantilever", "sequential"),
    "stability.assessment": ("Stability", "assess_steps"),
    "study.published": ("CRITERIA",),
    "workflow": ("optimize",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [  # noqa: RUF022  # in the order in which they are met
    "Scene",
    "Robot",
    "Sphere",
    "load_scene",
    "save_scene",
    "ArchShape",
    "arch_scene",
    "Network",
    "build_network",
    "Step",
    "Schedule",
    "sequential",
    "cantilever",
    "three_robot_loop",
    "modified_sequential",
    "read_plan",
    "read_schedule",
    "Engine",
    "make_engine",
    "analyze",
    "CRITERIA",
    "StepCost",
    "Limit",
    "Problem",
    "pose",
    "Formulation",
    "formulations",
    "FreeRules",
    "solve",
    "optimize",
    "scenarios",
    "Plan",
    "GivenSequence",
    "Certificate",
    "DRY",
    "EPOXY",
    "assess_steps",
    "Stability",
    "SeqoptError",
    "__version__",
]


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
