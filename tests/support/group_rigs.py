"""Rigs of heads and turntables in tables, and their plans."""

import copy
from typing import Any

import trimesh

from geometry.mesh.mesh import TriangleMesh
from planning import load_rig
from planning.model.plan import RigPlan
from planning.pipeline import plan_rig
from planning.rig.rig import Rig

_LENS: dict[str, Any] = {"resolution_px": [800, 600], "focal_px": [1200.0, 1200.0]}
_SHARP = {"range_mm": [300.0, 1500.0]}
HEAD: dict[str, Any] = {
    "name": "twin",
    "working_mm": 600.0,
    "near_mm": 450.0,
    "far_mm": 750.0,
    "near_size_mm": [280.0, 210.0],
    "far_size_mm": [460.0, 350.0],
    "projector": [
        {"name": "p", "position_mm": [20.0, 0.0, 0.0], "aim_mm": [0.0, 0.0, 600.0]}
    ],
    "camera": [
        {"name": "l", "position_mm": [-160.0, 0.0, 0.0], "aim_mm": [0.0, 0.0, 600.0]},
        {"name": "r", "position_mm": [160.0, 0.0, 0.0], "aim_mm": [0.0, 0.0, 600.0]},
    ],
}
DEVICES: dict[str, Any] = {
    "projector": {"name": "lamp", **_LENS, **_SHARP},
    "camera": {"name": "eye", **_LENS, **_SHARP},
    "limits": {"max_sigma_mm": 1.0},
    "placement": {"standoff_mm": 600.0},
    "requirements": {"region_coverage": 0.0},
}
_TABLE = {"point_mm": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "steps": 8}


def head_rig(*, head: dict[str, Any] | None = None, **tables: Any) -> Rig:
    """A rig with one head of a projector between two cameras."""
    written = copy.deepcopy(DEVICES | {"name": "heads", "head": HEAD}) | tables
    written["head"] |= head or {}
    return load_rig(written)


def table_rig(*, table: dict[str, Any] | None = None, **tables: Any) -> Rig:
    """A rig with a turntable of eight angles."""
    written = copy.deepcopy(DEVICES | {"name": "table", "turntable": _TABLE}) | tables
    written["turntable"] |= table or {}
    return load_rig(written)


def egg() -> TriangleMesh:
    """An egg of 100 x 120 x 160 mm that no single view sees all of."""
    solid = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    return TriangleMesh(solid.vertices * [1.0, 1.2, 1.6], solid.faces)


def planned(rig: Rig, **asked: Any) -> RigPlan:
    """The plan of an egg, its whole surface the target, without the check."""
    wanted: dict[str, Any] = {"target": "surface", "check": False, "threads": 1}
    return plan_rig(egg(), rig, on_miss="return", **(wanted | asked))
