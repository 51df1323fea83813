"""Plan, verify and export structured-light rigs."""

from importlib import import_module
from typing import TYPE_CHECKING

try:
    from geometry._siblings import check_siblings
except ModuleNotFoundError:
    # Of a stranger's `geometry` the other one tells.
    from solvers._siblings import check_siblings

if TYPE_CHECKING:
    from geometry.files.readers import load_mesh as load_mesh
    from geometry.mesh.mesh import MeshError as MeshError
    from planning.cache.cache import Cache as Cache
    from planning.handover.handed_plan import HandedPlan
    from planning.handover.planner import Planner as Planner
    from planning.handover.planner import plan_rig as plan_rig
    from planning.handover.planner import prepare as prepare
    from planning.handover.planner import sweep as sweep
    from planning.model.errors import CalibrationError as CalibrationError
    from planning.model.errors import CapturesError as CapturesError
    from planning.model.errors import InfeasibleLimitsError as InfeasibleLimitsError
    from planning.model.errors import InputError as InputError
    from planning.model.errors import PlanFileError as PlanFileError
    from planning.model.errors import PlanningError as PlanningError
    from planning.model.errors import RigError as RigError
    from planning.model.errors import TimeLimitError as TimeLimitError
    from planning.model.plan import InterruptedPlanError as InterruptedPlanError
    from planning.model.plan import RequirementError as RequirementError
    from planning.rig.mounted import read_mounted as read_mounted
    from planning.rig.rig import Rig as Rig
    from planning.rig.rig import load_rig as load_rig
    from planning.scene.interest import read_selection as read_selection
    from planning.scene.interest import read_weight as read_weight
    from planning.scene.ranges.ranged_body import RangedBody as RangedBody
    from planning.scene.ranges.ranged_body import read_ranges as read_ranges
    from planning.verify.verdict import Verification as Verification
    from planning.verify.verification import verify_plan as verify_plan

    RigPlan = HandedPlan

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "geometry.files.readers": ("load_mesh",),
    "geometry.mesh.mesh": ("MeshError",),
    "planning.cache.cache": ("Cache",),
    "planning.handover.planner": ("Planner", "plan_rig", "prepare", "sweep"),
    "planning.model.errors": (
        *("CalibrationError", "CapturesError", "InfeasibleLimitsError", "InputError"),
        *("PlanFileError", "PlanningError", "RigError", "TimeLimitError"),
    ),
    "planning.model.plan": ("InterruptedPlanError", "RequirementError"),
    "planning.rig.mounted": ("read_mounted",),
    "planning.rig.rig": ("Rig", "load_rig"),
    "planning.scene.interest": ("read_selection", "read_weight"),
    "planning.scene.ranges.ranged_body": ("RangedBody", "read_ranges"),
    "planning.verify.verification": ("Verification", "verify_plan"),
}
_HOME = {name: home for home, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> object:
    if name == "RigPlan":
        return import_module("planning.handover.handed_plan").HandedPlan
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*_HOME, "RigPlan"])


check_siblings()
