"""Turns a draft into a plan: poses rounded, every claim recomputed from them."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from planning.cameras.baselines.baseline_rows import baseline_rows
from planning.cameras.baselines.seams import overlap_components
from planning.cameras.routes import routes_entry
from planning.model.plan import FORMAT, VERSION, RigPlan
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.model.surface import Surface
from planning.report.advice.what_helps import add_what_helps
from planning.report.entries.cost import cost_entry
from planning.report.entries.overlaps import overlap_entries
from planning.report.entries.range_entries import ranges_entry, with_spread
from planning.report.entries.ring_entries import (
    evenly_ringed,
    lost_to_rings_m2,
    with_rings,
)
from planning.rings.ring_axes import widest_gap

from .claims import Claims, Devices, make_claims
from .entries import device_entries as entries
from .marginal import camera_table, projector_table
from .partial_plan import PartialPlan


def write_plan(draft: PartialPlan, clock: Stopwatch) -> RigPlan:
    """Round the poses, recompute every claim from them, and write the document."""
    projectors = tuple(
        entries.rounded_projector(p, f"P{i}")
        for i, p in enumerate(draft.final_projectors, 1)
    )
    cameras = tuple(
        entries.rounded_camera(c, f"C{i}") for i, c in enumerate(draft.cameras, 1)
    )
    reference = tuple(entries.rounded_projector(p, "") for p in draft.stage.reference)
    reference_cameras = tuple(
        entries.rounded_camera(c, "") for c in draft.camera_stage.reference
    )
    devices = Devices(projectors, cameras, reference, reference_cameras)
    scene = draft.scene
    standing = scene.among((*projectors, *cameras))
    with clock.stage("claims", "coverage, recomputed from the rounded poses"):
        claims = make_claims(scene, devices)
        marginal = [
            *projector_table(scene, devices, draft.stage.by_count, claims),
            # Rings are fine for the planned cameras; others would get their own.
            *camera_table(
                scene,
                evenly_ringed(devices, draft.rings),
                draft.camera_stage.by_count,
                claims,
            ),
        ]
    surface = Surface(
        scene.mesh,
        np.zeros(len(scene.mesh.faces), dtype=np.int64),
        scene.region,
        scene.steep,
        np.stack([p.world_from_device for p in reference]),
        np.stack([p.world_from_ring for p in reference]),
        np.stack([c.world_from_device for c in reference_cameras]),
    )
    requirements = _final_requirements(draft, claims, devices)
    document = _document(
        replace(draft, scene=standing),
        clock,
        devices,
        claims,
        requirements,
        marginal,
        surface,
    )
    add_what_helps(document, draft, devices, claims, clock)
    return RigPlan.from_document(document, surface)


def _final_requirements(
    draft: PartialPlan, claims: Claims, devices: Devices
) -> Requirements:
    """State tau, one ring gap, and the reference sets as they are."""
    requirements = draft.scene.requirements
    workspace = replace(
        requirements.workspace,
        n_reference_projectors=len(devices.reference_projectors),
        n_reference_cameras=len(devices.reference_cameras),
    )
    scene = draft.scene.among((*devices.projectors, *devices.cameras))
    gap = widest_gap(scene, devices.projectors, claims.target_samples)
    check = replace(requirements.check, tau_m=round(gap, 6))
    return replace(requirements, workspace=workspace, check=check)


def _document(
    draft: PartialPlan,
    clock: Stopwatch,
    devices: Devices,
    claims: Claims,
    requirements: Requirements,
    marginal: list[dict[str, Any]],
    surface: Surface,
) -> dict[str, Any]:
    samples = claims.target_samples.samples
    coverage = entries.coverage_entry(claims)
    coverage["lost_to_rings_m2"] = lost_to_rings_m2(
        draft.scene, devices, draft.rings, claims
    )
    regions = [
        {
            "id": region.id,
            "area_m2": region.area_m2,
            "n_faces": len(region.faces),
            "mean_normal": region.mean_normal.tolist(),
            "cone_angle": region.cone_angle,
            "mean_curvedness": region.mean_curvedness,
            **entry,
        }
        for region, entry in zip(draft.regions, claims.regions, strict=True)
    ]
    greedy = draft.camera_stage.certificate["greedy_count"]
    baselines = baseline_rows(
        devices.cameras,
        samples.points,
        samples.normals,
        claims.measured_by,
        samples.weight,
        requirements.camera.max_incidence,
    )
    ranges: dict[str, Any] = {}
    if draft.order.ranges is not None:
        body, guard = draft.order.ranges
        ranges = {"ranges": ranges_entry(body, guard)}
        baselines = with_spread(baselines, devices.cameras, body.ball, guard)
    return {
        "format": FORMAT,
        "version": VERSION,
        "units": {"length": "m", "angle": "rad"},
        "seed": draft.order.seed,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": list(draft.order.command),
        "truncated": draft.truncated,
        "meshes": [entries.mesh_entry(draft.scene.mesh, draft.scene.shell)],
        "surface": {
            "path": "surface.npz",
            "sha256": surface.sha256(),
            "curvature_radius_m": draft.curvature_radius_m,
            "dominant_share": draft.regions.dominant_share,
            "selection": entries.selection_entry(
                draft.scene.mesh, draft.scene.region, draft.order.interest
            ),
        },
        "rig": draft.order.rig.to_document(),
        "requirements": requirements.to_document(),
        "regions": regions,
        "projectors": with_rings(
            entries.projector_entries(devices.projectors, claims),
            draft.scene,
            devices,
            draft.rings,
        ),
        "cameras": entries.camera_entries(devices.cameras, claims),
        "coverage": coverage,
        **overlap_entries(draft.scene, devices.projectors),
        "marginal": marginal,
        "certificates": {
            "projectors": draft.stage.certificate,
            "cameras": draft.camera_stage.certificate
            | routes_entry(draft.camera_stage.routes),
        },
        "baselines": baselines,
        **ranges,
        "camera_groups": [
            [devices.cameras[c].id for c in group]
            for group in overlap_components(claims.measured_by, samples.weight)
        ],
        "cost": cost_entry(devices.cameras, greedy, clock.processor),
        "members": [
            {
                "mesh": 0,
                "coverage": coverage,
                "regions": [region["id"] for region in regions],
                "reconstruction": None,
            }
        ],
        "reconstruction": None,
        "timings_s": dict(clock.seconds),
    }
