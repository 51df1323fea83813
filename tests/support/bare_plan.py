"""A plan of devices and limits that claims nothing."""

from typing import Any

import numpy as np

from planning.model.plan import RigPlan
from planning.model.surface import Surface

_NO_AREAS = dict.fromkeys(
    (
        "area_m2",
        "reachable_by_projectors_m2",
        "lit_m2",
        "reachable_by_cameras_m2",
        "measured_m2",
    ),
    0.0,
)
_NO_PROOF = {
    "count": 0,
    "status": "feasible",
    "required_m2": 0.0,
    "n_samples": 0,
    "candidates": {"lower_bound": 0, "n_candidates": 0},
    "continuous": None,
    "greedy_count": 0,
    "needed": {"count": 0, "lower_bound": 0},
    "best_area": {"value_m2": 0.0, "upper_bound_m2": 0.0},
    "one_fewer": None,
}
_NO_COST = {"pixels": 0, "n_cameras_before": 0, "t4": 0.0, "t5": 0.0} | dict.fromkeys(
    ("t1", "t2", "t3", "C", "C_before")
)
_NO_MODEL = {"K": None, "resolution": [1, 1], "range_m": [0.0, 1.0]}


def bare_plan(
    requirements: dict[str, Any],
    projectors: list[dict[str, Any]],
    cameras: list[dict[str, Any]],
    surface: Surface,
    **sections: object,
) -> RigPlan:
    """Return a plan of devices; their tables may lack what they claim.

    Args:
        requirements: Plain values.
        projectors: Plain values.
        cameras: Plain values.
        surface: What the devices look at.
        **sections: Other sections of the plan.
    """
    no_light = {"lit_area_m2": 0.0, "min_margin_rad": None}
    unseen = {"seen_area_m2": 0.0, "sole_area_m2": 0.0}
    document: dict[str, Any] = {
        "format": "ringrig-plan",
        "version": 1,
        "units": {"length": "m", "angle": "rad"},
        "seed": 0,
        "created": "",
        "command": [],
        "truncated": False,
        "meshes": [_mesh_entry(surface)],
        "surface": {
            "path": "surface.npz",
            "sha256": "",
            "curvature_radius_m": 0.0,
            "dominant_share": 1.0,
        },
        "rig": {
            "light": projectors[0]["light"] if projectors else "diverging",
            "projector": _NO_MODEL,
            "camera": _NO_MODEL,
        },
        "requirements": requirements,
        "regions": [],
        "projectors": [no_light | entry for entry in projectors],
        "cameras": [unseen | entry for entry in cameras],
        "coverage": {
            "samples": 0,
            "surface": _NO_AREAS,
            "target": _NO_AREAS,
            "uncovered_by_cause": {},
            "unreachable_by_cause": {},
        },
        "marginal": [],
        "certificates": {"projectors": _NO_PROOF, "cameras": _NO_PROOF},
        "baselines": [],
        "cost": _NO_COST,
        "members": [],
        "reconstruction": None,
        "timings_s": {},
    }
    return RigPlan.from_document(_plain(document | sections), surface)


def _mesh_entry(surface: Surface) -> dict[str, Any]:
    mesh = surface.mesh
    counts = {"n_vertices": len(mesh.vertices), "n_faces": len(mesh.faces)}
    source = {"path": None, "sha256": None, "unit": "m", "scale_to_m": 1.0}
    return source | counts | {"area_m2": mesh.area}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(part) for part in value]
    return value.item() if isinstance(value, np.generic) else value
