"""Writes the plan's JSON document; every number a claim rests on is rounded here."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.repair.hollow import MeshShell
from planning.model.bodies import body_entry
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.rounding import DECIMALS, rounded_pose
from planning.report.claims import Claims
from planning.scene.interest import Interest


def rounded_projector(projector: PlannedProjector, name: str) -> PlannedProjector:
    """Return a projector as it will be written; its ring frame moves along with it."""
    device = rounded_pose(projector.world_from_device)
    ring = projector.world_from_ring.copy()
    ring[:3, 3] += device[:3, 3] - projector.world_from_device[:3, 3]
    return replace(
        projector,
        id=name,
        world_from_device=device,
        world_from_ring=np.round(ring, DECIMALS) + 0.0,
        ring_radii=np.round(projector.ring_radii, DECIMALS),
    )


def rounded_camera(camera: PlannedCamera, name: str) -> PlannedCamera:
    """Return a camera as it will be written."""
    pose = rounded_pose(camera.world_from_device)
    return replace(camera, id=name, world_from_device=pose)


def projector_entries(
    projectors: Sequence[PlannedProjector], claims: Claims
) -> list[dict[str, Any]]:
    """Return the plan's `projectors`."""
    return [
        {
            "id": projector.id,
            "light": projector.light,
            "world_from_device": projector.world_from_device.tolist(),
            "world_from_ring": projector.world_from_ring.tolist(),
            **_optics(projector.device),
            "ring_radii": projector.ring_radii.tolist(),
            "min_margin_rad": claims.min_margin_rad[index],
            "lit_area_m2": claims.lit_area_m2[index],
            **body_entry(projector.body),
            **_existing(projector),
        }
        for index, projector in enumerate(projectors)
    ]


def camera_entries(
    cameras: Sequence[PlannedCamera], claims: Claims
) -> list[dict[str, Any]]:
    """Return the plan's `cameras`."""
    return [
        {
            "id": camera.id,
            "world_from_device": camera.world_from_device.tolist(),
            "K": camera.device.camera_matrix.tolist(),
            "distortion": list(camera.device.distortion),
            "resolution": list(camera.device.resolution),
            "range_m": list(camera.device.range_m),
            "seen_area_m2": claims.seen_area_m2[index],
            "sole_area_m2": claims.sole_area_m2[index],
            **body_entry(camera.body),
            **_existing(camera),
        }
        for index, camera in enumerate(cameras)
    ]


def mesh_entry(mesh: TriangleMesh, shell: MeshShell) -> dict[str, Any]:
    """Return one entry of the plan's `meshes`."""
    source = mesh.source
    if source is None:
        return {
            "path": None,
            "sha256": None,
            "unit": "m",
            "scale_to_m": 1.0,
            "n_vertices": len(mesh.vertices),
            "n_faces": len(mesh.faces),
            "area_m2": mesh.area,
            "repairs": [],
            "shell": asdict(shell),
        }
    return {
        "path": source.path,
        "sha256": source.sha256,
        "unit": source.unit,
        "scale_to_m": source.scale_to_m,
        "n_vertices": source.n_vertices,
        "n_faces": source.n_faces,
        "area_m2": mesh.area,
        "repairs": [{"kind": r.kind, "count": r.count} for r in source.repairs],
        "shell": asdict(shell),
    }


def selection_entry(
    mesh: TriangleMesh, region: NDArray[np.int64], interest: Interest | None
) -> dict[str, Any]:
    """Return `surface.selection`: what the faces with a region were chosen by."""
    chosen = region >= 0
    return {
        "kind": "curvature" if interest is None else interest.kind,
        "source": None if interest is None else interest.source,
        "sha256": None if interest is None else interest.sha256,
        "n_faces": int(chosen.sum()),
        "area_m2": float(mesh.face_areas[chosen].sum()),
        "n_removed_by_repair": 0 if interest is None else interest.n_removed,
    }


def coverage_entry(claims: Claims) -> dict[str, Any]:
    """Return the plan's `coverage`."""
    return {
        "samples": len(claims.target_samples),
        "surface": claims.surface.to_document(),
        "target": claims.target.to_document(),
        "uncovered_by_cause": claims.uncovered_by_cause,
        "unreachable_by_cause": claims.unreachable_by_cause,
        "unreachable_inside_m2": claims.unreachable_inside_m2,
        **_by_body(claims),
    }


def _by_body(claims: Claims) -> dict[str, Any]:
    """What bodies keep from being measured; nothing where no device has one."""
    areas = claims.blocked_by_body_m2
    return {"blocked_by_body_m2": areas} if areas else {}


def _existing(device: PlannedProjector | PlannedCamera) -> dict[str, Any]:
    """Mark a device that stands already; nothing where it is planned."""
    return {"existing": True, "name": device.existing} if device.existing else {}


def _optics(device: PinholeModel | ParallelModel) -> dict[str, Any]:
    pinhole = isinstance(device, PinholeModel)
    return {
        "K": device.camera_matrix.tolist() if pinhole else None,
        "resolution": list(device.resolution),
        "pixel_pitch_m": None if pinhole else device.pixel_pitch_m,
        "range_m": list(device.range_m),
        "beam_radius": None if pinhole else device.beam_radius,
    }
