"""Devices as they will be written; records of mesh, target, coverage."""

import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import MeshSource, TriangleMesh
from geometry.regions.regions import DominantRegions
from geometry.repair.hollow import MeshShell
from planning.model.devices.bodies import Mount
from planning.model.devices.device_poses import DECIMALS, rounded_pose
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.coverage_records import RegionRecord
from planning.model.document.device_records import (
    CameraRecord,
    ProjectorRecord,
    camera_record,
    projector_record,
)
from planning.model.document.input_records import (
    MeshRecord,
    SelectionRecord,
    SurfaceRecord,
)
from planning.model.document.part import Vector3
from planning.model.document.ring_records import (
    OtherAxes,
    OtherRings,
    RingAxes,
    RingsRecord,
)
from planning.model.surface import Surface
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.report.partial_plan import PartialPlan, Prepared
from planning.rings.ring_shares import ring_shares
from planning.rings.written_rings import told_again
from planning.scene.interest import Interest
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene
from planning.scene.workspace.mount_settings import device_from_mount

from .exposure_entries import exposure_records


def device_ids(
    devices: Sequence[PlannedProjector | PlannedCamera], letter: str
) -> list[str]:
    """Return P1, P2 and so on; one that stands already under such a name keeps it."""
    numbered = re.compile(rf"{letter}[1-9]\d*")
    kept = {d.existing for d in devices if numbered.fullmatch(d.existing)}
    every = (f"{letter}{number}" for number in count(1))
    spare = (name for name in every if name not in kept)
    return [d.existing if d.existing in kept else next(spare) for d in devices]


def rounded_projector(projector: PlannedProjector, name: str) -> PlannedProjector:
    """Return a projector as it will be written; its ring frame moves along with it."""
    device = rounded_pose(projector.world_from_device)
    if projector.code is not None:
        # A code of pixels has no rings: their frame is the device's, to the last digit.
        return replace(
            projector, id=name, world_from_device=device, world_from_ring=device
        )
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


def projector_records(
    scene: Scene,
    devices: Devices,
    rings: Sequence[RingsRecord] | None,
    claims: Claims,
) -> tuple[ProjectorRecord, ...]:
    """Return the plan's `projectors`; no `rings` where the run was cut before them."""
    exposed = exposure_records(scene, devices, claims)
    return tuple(
        projector_record(
            projector,
            min_margin_rad=claims.min_margin_rad[p],
            lit_area_m2=claims.lit_area_m2[p],
        ).changed(
            **_mounted(scene.requirements.workspace.projector_mount, projector),
            rings=None if rings is None else told_again(scene, projector, rings[p]),
            **_shares(scene, projector, devices),
            **exposed[p],
        )
        for p, projector in enumerate(devices.projectors)
    )


def _shares(
    scene: Scene, projector: PlannedProjector, devices: Devices
) -> dict[str, Any]:
    """What becomes of its rings; no key where it has none."""
    if projector.code is not None:
        return {}
    return {"ring_shares": ring_shares(scene, projector, devices.cameras)}


def axes_record(
    scene: Scene, partial: PartialPlan, devices: Devices, claims: Claims
) -> RingAxes | None:
    """Return `ring_axes`: what was asked and taken, and what others would measure.

    None where the pattern has none.
    """
    request, other = partial.request, None
    if partial.axes is None:
        return None
    if partial.other_axes:
        pairs = zip(partial.other_axes, devices.projectors, strict=True)
        turned = [rounded_projector(p, planned.id) for p, planned in pairs]
        other = OtherAxes(
            axis="free" if partial.axes == "centred" else "centred",
            projectors=tuple(
                OtherRings(
                    id=p.id,
                    world_from_ring=p.world_from_ring.tolist(),
                    ring_radii=tuple(p.ring_radii.tolist()),
                )
                for p in turned
            ),
            measured_m2=measured_with(scene, turned, devices.cameras, claims),
        )
    asked = request.wishes.ring_axis or request.rig.rings.axis
    return RingAxes(asked=asked, taken=partial.axes, other=other)


def measured_with(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    claims: Claims,
) -> float:
    """Return what cameras measure of the target with other projectors [m²]."""
    samples = lit_samples(scene, projectors, claims.target_samples)
    measured = measured_by(scene, cameras, samples).any(axis=1)
    return claims.target_samples.samples.weight * int(measured.sum())


def camera_records(
    scene: Scene, cameras: Sequence[PlannedCamera], claims: Claims
) -> tuple[CameraRecord, ...]:
    """Return the plan's `cameras`."""
    return tuple(
        camera_record(
            camera,
            seen_area_m2=claims.seen_area_m2[c],
            sole_area_m2=claims.sole_area_m2[c],
        ).changed(**_mounted(scene.requirements.workspace.camera_mount, camera))
        for c, camera in enumerate(cameras)
    )


def _mounted(mount: Mount | None, device: Device) -> dict[str, Any]:
    """The pose of a device's mount; no key where the rig doesn't have it."""
    frame = None if mount is None else device_from_mount(mount)
    if frame is None:
        return {}
    pose = device.world_from_device @ frame
    return {"world_from_mount": (np.round(pose, DECIMALS) + 0.0).tolist()}


def mesh_record(mesh: TriangleMesh, shell: MeshShell) -> MeshRecord:
    """Return one entry of the plan's `meshes`."""
    n_vertices, n_faces = len(mesh.vertices), len(mesh.faces)
    source = mesh.source or MeshSource("", "", "m", 1.0, n_vertices, n_faces)
    figures: dict[str, Any] = asdict(source) | {
        "shell": asdict(shell),
        "area_m2": mesh.area,
    }
    for name in ("path", "sha256"):
        figures[name] = figures[name] or None
    return MeshRecord(**figures)


def selection_record(
    mesh: TriangleMesh,
    region: NDArray[np.int64],
    interest: Interest | None,
    target: str,
) -> SelectionRecord:
    """Return `surface.selection`: what the faces with a region were chosen by."""
    chosen = region >= 0
    by = "outside" if target == "outside" else "curvature"
    interest = interest or Interest(by, chosen)
    return SelectionRecord(
        kind=interest.kind,
        source=interest.source,
        sha256=interest.sha256,
        n_faces=int(chosen.sum()),
        area_m2=float(mesh.face_areas[chosen].sum()),
        n_removed_by_repair=interest.n_removed,
    )


def surface_record(ready: Prepared, surface: Surface) -> SurfaceRecord:
    """Return the plan's `surface`."""
    scene = ready.scene
    return SurfaceRecord(
        path="surface.npz",
        sha256=surface.sha256(),
        curvature_radius_m=ready.curvature_radius_m,
        dominant_share=ready.regions.dominant_share,
        selection=selection_record(
            scene.mesh,
            scene.region,
            ready.request.interest,
            scene.requirements.target,
        ),
    )


def region_records(
    mesh: TriangleMesh, regions: DominantRegions, claims: Claims
) -> tuple[RegionRecord, ...]:
    """Return the plan's `regions`."""
    return tuple(
        RegionRecord(
            id=region.id,
            area_m2=region.area_m2,
            n_faces=len(region.faces),
            mean_normal=region.mean_normal.tolist(),
            cone_angle=region.cone_angle,
            mean_curvedness=region.mean_curvedness,
            lit_by=claim.lit_by,
            lit_fraction=claim.lit_fraction,
            centre_m=_centre(mesh, region.faces),
            coverage=claim.coverage,
        )
        for region, claim in zip(regions, claims.regions, strict=True)
    )


def _centre(mesh: TriangleMesh, faces: NDArray[np.int64]) -> Vector3:
    areas = mesh.face_areas[faces]
    x, y, z = (areas @ mesh.face_centroids[faces] / areas.sum()).tolist()
    return x, y, z
