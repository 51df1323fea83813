"""Plan, verify and export structured-light rigs."""

from importlib import import_module
from typing import TYPE_CHECKING

from ._siblings import check_siblings

if TYPE_CHECKING:
    from geometry.files.readers import load_mesh as load_mesh
    from planning.model.errors import InputError as InputError
    from planning.model.errors import PlanningError as PlanningError
    from planning.model.plan import RequirementError as RequirementError
    from planning.model.plan import RigPlan as RigPlan
    from planning.rig.mounted import read_mounted as read_mounted
    from planning.rig.rig import Rig as Rig
    from planning.rig.rig import load_rig as load_rig
    from planning.scene.interest import read_selection as read_selection
    from planning.scene.interest import read_weight as read_weight
    from planning.scene.ranges.ranged_body import RangedBody as RangedBody
    from planning.scene.ranges.ranged_body import read_ranges as read_ranges
    from planning.verify.verification import Verification as Verification
    from planning.verify.verification import verify_plan as verify_plan

    from .pipeline import plan_rig as plan_rig

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "InputError": "planning.model.errors",
    "PlanningError": "planning.model.errors",
    "RequirementError": "planning.model.plan",
    "RangedBody": "planning.scene.ranges.ranged_body",
    "Rig": "planning.rig.rig",
    "RigPlan": "planning.model.plan",
    "Verification": "planning.verify.verification",
    "load_mesh": "geometry.files.readers",
    "load_rig": "planning.rig.rig",
    "plan_rig": "planning.pipeline",
    "read_mounted": "planning.rig.mounted",
    "read_ranges": "planning.scene.ranges.ranged_body",
    "read_selection": "planning.scene.interest",
    "read_weight": "planning.scene.interest",
    "verify_plan": "planning.verify.verification",
}


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_EXPORTS[name]), name)


def __dir__() -> list[str]:
    return list(_EXPORTS)


check_siblings()
