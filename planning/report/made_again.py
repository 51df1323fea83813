"""A plan's figures, computed again by the code that made them, from its files alone.

The audit is the judge of whether a claim is true, and knows it within what samples
tell. This is the other half: of the same code, libraries, arithmetic and seed every
figure is the same to the last digit, and one that was edited isn't.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from geometry.curvature.curvature import CurvatureField, principal_curvatures
from geometry.regions.regions import DominantRegions, dominant_regions
from geometry.regions.selected_regions import regions_of_faces
from geometry.repair.hollow import outside_faces
from planning.cameras.baselines.baseline_rows import baseline_rows
from planning.cameras.baselines.seams import SampledSurface, overlap_components
from planning.model.document.coverage_records import (
    CameraMarginal,
    Coverage,
    ProjectorMarginal,
)
from planning.model.document.part import Part
from planning.model.plan import RigPlan
from planning.rings.written_rings import evenly_ringed
from planning.scene.scene import Scene

from .advice.camera_relaxations import unmeasurable_by_cause
from .advice.what_helps import cameras_reach_too_little
from .claims.claims import Claims, make_claims, tau_m
from .claims.judged import Devices
from .claims.marginal import OfNumber, marginal_records
from .entries import device_entries as entries
from .entries.overlaps import overlap_records
from .entries.survival_entries import survival_record
from .offered_again import offered_again
from .written_plan import written_devices, written_scene


def why_not_again(plan: RigPlan) -> str:
    """Why a plan's figures aren't computed again from its files; "": they are."""
    document = plan.document
    if document.family is not None or plan.of_member:
        return "the plan is of a family, whose members share samples"
    if plan.cameras_alone:
        return "cameras measure alone"
    if document.stations is not None:
        return "devices are at stations, whose reference poses go by heads"
    if plan.requirements.robust is not None:
        return "requirements were tightened for drawn rigs"
    return ""


def again_or_why_not(plan: RigPlan, threads: int) -> dict[str, Any] | str:
    """Return parts of the document as they come out again, or why they can't."""
    return why_not_again(plan) or made_again(plan, threads=threads)


def made_again(plan: RigPlan, *, threads: int) -> dict[str, Any]:
    """Return parts of the document as they come out again; keys are the document's.

    Raises:
        ValueError: If `why_not_again` says why.
    """
    if why := why_not_again(plan):
        raise ValueError(f"figures can't be computed again: {why}")
    scene, devices = written_scene(plan, threads=threads), written_devices(plan)
    claims, document = make_claims(scene, devices), plan.document
    among = scene.among((*devices.projectors, *devices.cameras))
    overlaps, schedule = overlap_records(among, devices.projectors)
    rings = [record.rings for record in document.projectors]
    known = tuple(record for record in rings if record is not None)
    field = principal_curvatures(scene.mesh)
    regions = _regions(plan, scene, field)
    parts: dict[str, Any] = {
        "coverage": _coverage(plan, scene, devices, claims),
        "projectors": entries.projector_records(
            among, devices, known if len(known) == len(rings) else None, claims
        ),
        "cameras": entries.camera_records(among, devices.cameras, claims),
        "marginal": _marginal(plan, scene, devices, claims),
        "overlaps": overlaps,
        "firing_schedule": schedule,
        "camera_groups": tuple(
            tuple(devices.cameras[c].id for c in group)
            for group in overlap_components(claims.measured_by)
        ),
    }
    if np.array_equal(regions.face_region, scene.region):
        # Else the digest of the surface says that others come out.
        parts["regions"] = entries.region_records(scene.mesh, regions, claims)
    if document.ranges is None:
        # Spread of what is known by ranges takes their file.
        samples = claims.target_samples.samples
        parts["baselines"] = baseline_rows(
            devices.cameras,
            SampledSurface(samples.points, samples.normals),
            claims.measured_by,
            plan.requirements.camera.max_incidence,
        )
    if document.survival is not None:
        parts["survival"] = survival_record(scene, devices, claims, None)
    axes = document.ring_axes
    if axes is not None and axes.other is not None:
        measured_m2 = _measured_with_other_axes(plan, among, devices, claims)
        parts["ring_axes"] = {"other": {"measured_m2": measured_m2}}
    parts["requirements"] = {
        "check": {"tau_m": tau_m(among, devices.projectors, claims)}
    }
    parts["surface"] = {
        "curvature_radius_m": field.radius,
        "dominant_share": regions.dominant_share,
        "sha256": _surface_digest(plan, regions),
    }
    parts["rig"] = offered_again(plan, scene, devices)
    mesh = entries.mesh_record(scene.mesh, scene.shell).to_document()
    parts["meshes"] = [{name: mesh[name] for name in ("area_m2", "shell")}]
    return {key: _plain(part) for key, part in parts.items()}


def _coverage(
    plan: RigPlan, scene: Scene, devices: Devices, claims: Claims
) -> Coverage:
    """The claims' coverage, with why cameras reach too little where a plan says so."""
    coverage = claims.coverage
    if plan.document.truncated or not cameras_reach_too_little(
        plan.requirements, coverage
    ):
        return coverage
    causes = unmeasurable_by_cause(scene, devices, claims)
    return coverage.changed(unmeasurable_by_cause=causes)


def _regions(plan: RigPlan, scene: Scene, field: CurvatureField) -> DominantRegions:
    """The regions of the surface: of its curvature, its outside, or chosen faces."""
    mesh, by = scene.mesh, plan.document.faces_chosen_by
    if by == "curvature":
        return dominant_regions(mesh, field)
    chosen = plan.surface.in_dominant
    if by == "outside":
        chosen = outside_faces(scene.visibility.caster)
    return regions_of_faces(mesh, field, chosen)


def _surface_digest(plan: RigPlan, regions: DominantRegions) -> str:
    """The plan's own digest of its surface, if regions and T1 are those found again.

    Another zlib packs the same arrays otherwise, so that they are compared as numbers.
    """
    again = replace(
        plan.surface,
        region=regions.face_region,
        steep=regions.steep_on(plan.requirements.target),
    )
    same = np.array_equal(again.region, plan.surface.region) and np.array_equal(
        again.steep, plan.surface.steep
    )
    return plan.document.surface.sha256 if same else again.sha256()


def _marginal(
    plan: RigPlan, scene: Scene, devices: Devices, claims: Claims
) -> tuple[ProjectorMarginal | CameraMarginal | None, ...]:
    """The rows whose devices the file names; None for the others."""
    lights = {len(devices.projectors): OfNumber(devices.projectors)}
    views = {len(devices.cameras): OfNumber(devices.cameras)}
    for row in plan.document.marginal:
        if isinstance(row, ProjectorMarginal) and row.reference is not None:
            those = tuple(devices.reference_projectors[k] for k in row.reference)
            lights[row.n_projectors] = OfNumber(those, row.reference)
        elif isinstance(row, CameraMarginal) and row.reference is not None:
            chosen = tuple(devices.reference_cameras[k] for k in row.reference)
            views[row.n_cameras] = OfNumber(chosen, row.reference)
    for numbers in (lights, views):
        # One more than the plan's is never less than one fewer: that must be known.
        planned = next(iter(numbers))
        for n in sorted(numbers):
            if n > planned and n - 1 not in numbers:
                del numbers[n]
    records = [record.rings for record in plan.document.projectors]
    evenly = tuple(map(evenly_ringed, devices.projectors, records))
    rows = marginal_records(scene, devices, claims, (lights, views), evenly)
    made = {row.number: row for row in rows}
    return tuple(made.get(row.number) for row in plan.document.marginal)


def _measured_with_other_axes(
    plan: RigPlan, among: Scene, devices: Devices, claims: Claims
) -> float:
    axes = plan.document.ring_axes
    assert axes is not None
    assert axes.other is not None
    turned = [
        replace(
            projector,
            world_from_ring=np.array(other.world_from_ring),
            ring_radii=np.array(other.ring_radii),
        )
        for projector, other in zip(
            devices.projectors, axes.other.projectors, strict=True
        )
    ]
    return entries.measured_with(among, turned, devices.cameras, claims)


def _plain(value: object) -> Any:  # noqa: ANN401
    """Return a part as plain JSON values."""
    if isinstance(value, Part):
        return value.to_document()
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value
