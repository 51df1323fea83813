"""What can't be asked at all, or not together, told before any work."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeGuard, cast, get_args

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.cache.cache import Cache
from planning.model.document.certificates import CamerasBy
from planning.model.document.family_records import AlignedBy
from planning.model.document.ring_records import RingAxis
from planning.model.errors import InputError
from planning.report.partial_plan import PlanRequest
from planning.rig.mounted import Mounted
from planning.rig.rig import Rig
from planning.scene.ranges.ranged_body import RangedBody

from .asked.family_request import check_family
from .cameras_alone.refusals import check_alone
from .front.taken_point import TakenPoint
from .joint.joining import check_joint
from .stations.carried import check_carried
from .surviving import check_survival

# Of options of `plan_rig` whose values nothing that comes later refuses in a line: the
# values, the least whole number, and those that are any number.
_VALUES: dict[str, tuple[object, ...]] = {
    "align": get_args(AlignedBy),
    "cameras_by": get_args(CamerasBy),
    "on_miss": ("raise", "return"),
    "ring_axis": (None, *get_args(RingAxis)),
    **dict.fromkeys(("joint", "check", "prove"), (True, False)),
}
_LEAST = {
    **{"seed": 0, "survive": 0, "max_projectors": 0, "max_cameras": 0},
    **{"threads": 1, "views": 1, "max_heads": 1},
}
# No rig has more devices, and readers of plans refuse whole numbers beyond 2^53.
_MOST_DEVICES = 1_000_000
_NUMBERS = (
    *("coverage", "dominant_coverage", "min_reachable", "region_coverage"),
    *("accuracy_mm", "family_quantile", "robust", "time_limit"),
)
_NEVER_NONE = ("seed", "survive", "family_quantile", "mesh", "rig", "cache")
# Of those that no text and no number stands for: their types, and where they are from.
_TYPES: dict[str, tuple[Any, str]] = {
    "rig": (Rig, "a Rig; load_rig reads one by its name or file"),
    "cache": (Cache, "a Cache; leave it out to keep nothing"),
    "fixed": (Mounted, "a Mounted; read_mounted reads one from a file"),
    "take": (TakenPoint, "a TakenPoint; `plan --take` makes one of a kept front"),
    "progress": ((Callable, bool), "a function of a line, True or False"),
}
_MESH = "a mesh from load_mesh, a list of such, or a body from read_ranges"
# Of what is told of a value [characters].
_LONGEST = 60


def check_values(asked: Mapping[str, object]) -> None:
    """Refuse values that an option of `plan_rig` doesn't have, before any work.

    Raises:
        InputError: It names the option, its value and what that must be.
    """
    for name, value in asked.items():
        if must := _must_be(name, value):
            told = repr(value)
            if len(told) > _LONGEST or "\n" in told:
                told = f"a {type(value).__name__}"
            raise InputError(f"{name} = {told} must be {must}")


def _must_be(name: str, value: object) -> str:
    """Return what the value of an option must be and isn't; empty: it may be that."""
    # An array has no truth.
    if name in _VALUES and (np.ndim(cast(Any, value)) or value not in _VALUES[name]):
        return f"one of {', '.join(map(str, _VALUES[name]))}"
    if value is None and name not in _NEVER_NONE:
        return ""
    if name == "mesh" and not _meshes(value):
        return _MESH
    if name in _TYPES and not isinstance(value, _TYPES[name][0]):
        return _TYPES[name][1]
    if name in _LEAST and not (_whole(value) and value >= _LEAST[name]):
        return f"a whole number, {_LEAST[name]} or more"
    if name.startswith("max_") and _whole(value) and value > _MOST_DEVICES:
        return f"{_MOST_DEVICES} at most"
    real = isinstance(value, float | np.floating) and not np.isnan(value)
    if name in _NUMBERS and not (real or _whole(value)):
        return "a number"
    if name == "time_limit" and cast(float, value) <= 0.0:
        return "more than 0 s"
    return ""


def _meshes(value: object) -> bool:
    if isinstance(value, Sequence) and not isinstance(value, str):
        every = cast(Sequence[object], value)
        return all(isinstance(one, TriangleMesh) for one in every)
    return isinstance(value, TriangleMesh | RangedBody)


def _whole(value: object) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def check_request(request: PlanRequest) -> None:
    """Refuse what can't be planned together.

    Raises:
        InputError: It names both, and what to do.
    """
    if request.family is not None:
        check_family(request)
    check_carried(request)
    check_survival(request)
    if request.wishes.joint:
        check_joint(request)
    if request.wishes.pattern == "none":
        check_alone(request)
