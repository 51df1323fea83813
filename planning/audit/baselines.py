"""Claims of the baseline table: eqs. (9) and (10), row by row."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import TriangleMesh
from planning.plan import RigPlan

from .ledger import Ledger, as_number, entries

# Room for lengths and angles written with a few digits, and for E among them.
_LENGTH_M = 5e-5
_ANGLE = 1e-3


def audit_baselines(plan: RigPlan, ledger: Ledger) -> None:
    """Recompute each row from the poses, its E and its phi_max, in both orders.

    With w = O2 - O1 and a the axis of camera 1: d = |w|, axial part |w.a|, lateral part
    |w - (w.a) a|; D_i = |O_i - E|; phi = angle O1 E O2; slack = phi_max - phi;
    d_max^2 = D1^2 + D2^2 - 2 D1 D2 cos(phi_max), null where phi_max isn't in (0, pi).
    """
    poses = {camera.id: camera.world_from_device for camera in plan.cameras}
    seen: set[tuple[str, str]] = set()
    for place, row in enumerate(entries(plan.document["baselines"])):
        names = row.get("cameras")
        known = isinstance(names, list) and len(names) == 2 and names[0] != names[1]
        if not ledger.holds(
            known and set(names or ()) <= set(poses),
            f"baselines.{place}.cameras",
            f"{names!r} must be two cameras of the plan",
        ):
            continue
        first, second = names or ("", "")
        ledger.holds(
            (first, second) not in seen,
            f"baselines.{place}.cameras",
            f"the row of {first}, {second} stands there twice",
        )
        seen.add((first, second))
        key = f"baselines.{first}-{second}"
        _audit_row(key, row, poses[first], poses[second], plan.surface.mesh, ledger)
    for first, second in sorted(seen):
        ledger.holds(
            (second, first) in seen,
            "baselines",
            f"has {first}, {second} but not the order {second}, {first}",
        )


def _audit_row(
    key: str,
    row: Mapping[str, Any],
    pose1: NDArray[np.float64],
    pose2: NDArray[np.float64],
    mesh: TriangleMesh,
    ledger: Ledger,
) -> None:
    try:
        meeting = np.asarray(row.get("E"), dtype=np.float64)
    except (TypeError, ValueError):
        meeting = np.full(3, np.nan)
    if not ledger.holds(
        meeting.shape == (3,) and np.all(np.isfinite(meeting)),
        f"{key}.E",
        f"{row.get('E')!r} must be a point",
    ):
        return
    apart = distance_to_surface(mesh, meeting)
    ledger.holds(
        apart <= _LENGTH_M, f"{key}.E", f"lies {1e3 * apart:.3g} mm off the surface"
    )
    o1, o2, axis = pose1[:3, 3], pose2[:3, 3], pose1[:3, 2]
    to1, to2, baseline = o1 - meeting, o2 - meeting, o2 - o1
    axial = float(abs(baseline @ axis))
    phi = float(np.arctan2(np.linalg.norm(np.cross(to1, to2)), to1 @ to2))
    lengths = {
        "D1": float(np.linalg.norm(to1)),
        "D2": float(np.linalg.norm(to2)),
        "d": float(np.linalg.norm(baseline)),
        "d_lateral": float(np.linalg.norm(np.cross(baseline, axis))),
    }
    for name, value in lengths.items():
        ledger.number(f"{key}.{name}", row.get(name), value, _LENGTH_M, "m")
    claimed = as_number(row.get("d_axial"))
    ledger.number(
        f"{key}.d_axial",
        None if claimed is None else abs(claimed),
        axial,
        _LENGTH_M,
        "m",
    )
    ledger.number(f"{key}.phi", row.get("phi"), phi, _ANGLE, "rad")
    _audit_limit(key, row, phi, lengths["D1"], lengths["D2"], ledger)


def _audit_limit(
    key: str, row: Mapping[str, Any], phi: float, d1: float, d2: float, ledger: Ledger
) -> None:
    limit = as_number(row.get("phi_max"))
    if not ledger.holds(limit is not None, f"{key}.phi_max", "is missing"):
        return
    assert limit is not None
    slack = limit - phi
    ledger.number(f"{key}.slack", row.get("slack"), slack, _ANGLE, "rad")
    if not abs(slack) <= _ANGLE:
        ledger.holds(
            row.get("covered") is (slack > 0.0),
            f"{key}.covered",
            f"{row.get('covered')!r} is claimed, but phi_max - phi = {slack:.6g} rad",
        )
    if not 0.0 < limit < np.pi:
        ledger.holds(
            row.get("d_max") is None,
            f"{key}.d_max",
            f"{row.get('d_max')!r} is claimed, must be null: phi_max {limit:.6g} rad "
            f"isn't between 0 and pi",
        )
        return
    square = d1 * d1 + d2 * d2 - 2.0 * d1 * d2 * np.cos(limit)
    ledger.number(
        f"{key}.d_max", row.get("d_max"), float(np.sqrt(square)), 4 * _LENGTH_M, "m"
    )


def distance_to_surface(mesh: TriangleMesh, point: NDArray[np.float64]) -> float:
    """Return the distance of a point from the faces in [m], infinite if over 1 mm."""
    reach = np.linalg.norm(mesh.corners - mesh.face_centroids[:, None], axis=2).max(
        axis=1
    )
    near = np.linalg.norm(mesh.face_centroids - point, axis=1) <= reach + 1e-3
    corners = mesh.corners[near]
    if len(corners) == 0:
        return np.inf
    nexts = np.roll(corners, -1, axis=1)
    along = nexts - corners
    square = np.maximum((along * along).sum(axis=2), np.finfo(float).tiny)
    share = np.clip(((point - corners) * along).sum(axis=2) / square, 0.0, 1.0)
    edges = np.linalg.norm(corners + share[..., None] * along - point, axis=2).min(
        axis=1
    )
    normals = mesh.face_normals[near]
    inward = np.cross(normals[:, None], along)
    above = np.all(((point - corners) * inward).sum(axis=2) >= 0.0, axis=1)
    height = np.abs(((point - corners[:, 0]) * normals).sum(axis=1))
    best = np.where(above & np.any(normals != 0.0, axis=1), height, edges)
    return float(best.min())
