"""Plan, verify and export structured-light rigs."""

from importlib import import_module
from typing import TYPE_CHECKING

from ._siblings import check_siblings

if TYPE_CHECKING:
    from geometry.readers import load_mesh as load_mesh

    from .errors import InputError as InputError
    from .errors import PlanningError as PlanningError
    from .errors import RequirementError as RequirementError
    from .interest import read_selection as read_selection
    from .interest import read_weight as read_weight
    from .pipeline import plan_rig as plan_rig
    from .plan import RigPlan as RigPlan
    from .ranges import RangedBody as RangedBody
    from .ranges import read_ranges as read_ranges
    from .rig import Rig as Rig
    from .rig import load_rig as load_rig
    from .verification import Verification as Verification
    from .verification import verify_plan as verify_plan

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "InputError": "planning.errors",
    "PlanningError": "planning.errors",
    "RequirementError": "planning.errors",
    "RangedBody": "planning.ranges",
    "Rig": "planning.rig",
    "RigPlan": "planning.plan",
    "Verification": "planning.verification",
    "load_mesh": "geometry.readers",
    "load_rig": "planning.rig",
    "plan_rig": "planning.pipeline",
    "read_ranges": "planning.ranges",
    "read_selection": "planning.interest",
    "read_weight": "planning.interest",
    "verify_plan": "planning.verification",
}
__all__ = [
    "InputError",
    "PlanningError",
    "RangedBody",
    "RequirementError",
    "Rig",
    "RigPlan",
    "Verification",
    "load_mesh",
    "load_rig",
    "plan_rig",
    "read_ranges",
    "read_selection",
    "read_weight",
    "verify_plan",
]


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_EXPORTS[name]), name)


def __dir__() -> list[str]:
    return __all__


check_siblings()
