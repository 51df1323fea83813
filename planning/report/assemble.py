"""Turns a partial plan into a plan: poses rounded, every claim recomputed from them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from geometry.parallel import abandonable
from planning.cameras.baselines.baseline_rows import baseline_rows
from planning.cameras.baselines.seams import SampledSurface
from planning.model.document.certificates import Certificates
from planning.model.document.coverage_records import (
    CameraMarginal,
    Coverage,
    ProjectorMarginal,
    RegionRecord,
)
from planning.model.document.device_records import BaselineRow, EvaluationRecord
from planning.model.document.ring_records import RingsRecord
from planning.model.document.survival_records import SurvivalRecord
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.report.advice.floor_relaxations import (
    with_floor_relaxations,
    with_small_floor,
)
from planning.report.advice.what_helps import with_fewer_needed, with_relaxations
from planning.report.entries.overlaps import overlap_records
from planning.report.entries.plan_entry import Told, document_of
from planning.report.entries.proof_entry import with_proofs
from planning.report.entries.range_entries import ranges_record, with_spread
from planning.report.entries.station_entries import stations_record
from planning.report.entries.surface_entry import surface_of
from planning.report.entries.survival_entries import survival_record
from planning.report.entries.violations import violations
from planning.rings.written_rings import evenly_ringed
from planning.scene.scene import Scene

from .claims.claims import Claims, make_claims, tau_m
from .claims.judged import Devices
from .claims.marginal import marginal_records, of_numbers
from .entries import device_entries as entries
from .partial_plan import PartialPlan


class Claimed(Protocol):
    """A plan, or the draft of one: what is asked, and what comes of fresh samples."""

    @property
    def requirements(self) -> Requirements:
        """What is asked of the plan."""
        ...

    @property
    def coverage(self) -> Coverage:
        """Areas of the surface and the target."""
        ...

    @property
    def regions(self) -> Sequence[RegionRecord]:
        """What becomes of each region."""
        ...

    @property
    def survival(self) -> SurvivalRecord | None:
        """What is left after losses, where any are to be survived."""
        ...


def write_plan(partial: PartialPlan, clock: Stopwatch) -> RigPlan:
    """Round the poses, recompute every claim from them, and write the document.

    A plan that was cut goes without advice.
    """
    return Draft.of(partial, clock).written(clock)


@dataclass(frozen=True, eq=False)
class Draft:
    """A plan whose areas are known, before advice and certificates are spent on it.

    Attributes:
        partial: What it is written from.
        devices: With poses rounded as they will be written; areas are of these.
        claims: What they light and measure of fresh samples.
        marginal: What other numbers of devices would.
        survival: What is left of it after losses, where any are to be survived.
        regions: What becomes of each region.
    """

    partial: PartialPlan
    devices: Devices
    claims: Claims
    marginal: tuple[ProjectorMarginal | CameraMarginal, ...]
    survival: SurvivalRecord | None
    regions: tuple[RegionRecord, ...]

    @classmethod
    def of(cls, partial: PartialPlan, clock: Stopwatch) -> "Draft":
        """Round the poses and recompute every area from them."""
        devices, scene = _rounded_devices(partial), partial.scene
        with clock.stage("claims", "coverage, recomputed from the rounded poses"):
            claims = make_claims(scene, devices)
            marginal = _marginal(partial, devices, claims)
            survival = survival_record(scene, devices, claims, partial.surviving)
        regions = entries.region_records(scene.mesh, partial.ready.regions, claims)
        return cls(partial, devices, claims, marginal, survival, regions)

    @property
    def requirements(self) -> Requirements:
        """What is asked of the plan."""
        return self.partial.scene.requirements

    @property
    def coverage(self) -> Coverage:
        """What is lit and measured, of fresh samples."""
        return self.claims.coverage

    def written(self, clock: Stopwatch) -> RigPlan:
        """Return the plan, with advice and certificates unless it was cut short."""
        partial, devices, claims = self.partial, self.devices, self.claims
        scene, regions = partial.scene, self.regions
        among = scene.among((*devices.projectors, *devices.cameras))
        coverage, certificates = claims.coverage, _certificates(partial)
        if not partial.truncated:
            coverage = with_relaxations(partial, devices, claims, clock)
        if not partial.truncated and partial.stationed is None:
            regions = with_floor_relaxations(
                regions, claims.region_samples, partial.request.rig, devices
            )
            if not partial.request.evaluates:
                regions = with_small_floor(regions, partial.stage.candidates)
            certificates = with_fewer_needed(certificates, partial, clock)
        surface = surface_of(scene, devices, partial.ready)
        with (
            clock.stage("proofs", "certificates of the bounds over the candidates"),
            abandonable(1) as pool,
        ):
            # Deflating it leaves the interpreter to the proofs.
            packed = pool.submit(lambda: surface.sha256)
            certificates, proof = with_proofs(partial, certificates)
            packed.result()
        stationed = partial.stationed
        moved = stationed is not None and stationed.record.kind != "heads"
        overlaps, schedule = overlap_records(among, devices.projectors, moved=moved)
        requirements = _final_requirements(among, claims, devices)
        told = Told(
            requirements,
            coverage,
            regions,
            entries.projector_records(among, devices, _rings(partial), claims),
            entries.camera_records(among, devices.cameras, claims),
            self.marginal,
            certificates,
            _baselines(partial, devices, claims, requirements),
        )
        others: dict[str, Any] = {
            "ring_axes": entries.axes_record(among, partial, devices, claims),
            "overlaps": overlaps,
            "firing_schedule": schedule,
            "survival": self.survival,
        }
        if stationed is not None:
            others["stations"] = stations_record(stationed, devices)
        if partial.request.ranges is not None:
            others["ranges"] = ranges_record(*partial.request.ranges)
        mounted = partial.request.mounted
        if mounted is not None and partial.request.evaluates:
            broken = violations(scene, (*devices.projectors, *devices.cameras))
            others["evaluation"] = EvaluationRecord(
                path=mounted.path, sha256=mounted.sha256, violations=broken
            )
        document = document_of(
            *(partial.ready, surface, claims, told, clock),
            truncated=partial.truncated,
            **others,
        )
        return RigPlan(document, surface, proof=proof)


def as_truncated(plan: RigPlan) -> RigPlan:
    """Return a plan that says that its search was cut."""
    return replace(plan, document=plan.document.changed(truncated=True))


def _rounded_devices(partial: PartialPlan) -> Devices:
    """The devices and the reference sets as they will be written."""
    projectors, cameras = partial.final_projectors, partial.cameras
    lights = zip(projectors, entries.device_ids(projectors, "P"), strict=True)
    views = zip(cameras, entries.device_ids(cameras, "C"), strict=True)
    return Devices(
        tuple(entries.rounded_projector(p, name) for p, name in lights),
        tuple(entries.rounded_camera(c, name) for c, name in views),
        tuple(entries.rounded_projector(p, "") for p in partial.stage.reference),
        tuple(entries.rounded_camera(c, "") for c in partial.camera_stage.reference),
    )


def _rings(partial: PartialPlan) -> tuple[RingsRecord, ...] | None:
    return None if partial.rings is None else partial.rings.records


def _marginal(
    partial: PartialPlan, devices: Devices, claims: Claims
) -> tuple[ProjectorMarginal | CameraMarginal, ...]:
    stage, views = partial.stage, partial.camera_stage
    numbers = (
        of_numbers(
            stage.by_count,
            devices.projectors,
            (stage.reference, devices.reference_projectors),
            entries.rounded_projector,
        ),
        of_numbers(
            views.by_count,
            devices.cameras,
            (views.reference, devices.reference_cameras),
            entries.rounded_camera,
        ),
    )
    rings = _rings(partial) or (None,) * len(devices.projectors)
    evenly = tuple(map(evenly_ringed, devices.projectors, rings))
    return marginal_records(partial.scene, devices, claims, numbers, evenly)


def _final_requirements(scene: Scene, claims: Claims, devices: Devices) -> Requirements:
    """State tau and the reference sets as they are."""
    requirements = scene.requirements
    workspace = replace(
        requirements.workspace,
        n_reference_projectors=len(devices.reference_projectors),
        n_reference_cameras=len(devices.reference_cameras),
    )
    nearest = tau_m(scene, devices.projectors, claims)
    check = replace(requirements.check, tau_m=nearest)
    return replace(requirements, workspace=workspace, check=check)


def _certificates(partial: PartialPlan) -> Certificates:
    cameras, routes = partial.camera_stage.certificate, partial.camera_stage.routes
    if routes is not None:
        cameras = cameras.changed(routes=routes)
    projectors = partial.stage.certificate
    if partial.scene.requirements.region_coverage:
        floors = len(partial.scene.large_regions)
        projectors, cameras = (p.changed(floors=floors) for p in (projectors, cameras))
    return Certificates(projectors=projectors, cameras=cameras)


def _baselines(
    partial: PartialPlan, devices: Devices, claims: Claims, requirements: Requirements
) -> tuple[BaselineRow, ...]:
    samples = claims.target_samples.samples
    rows = baseline_rows(
        devices.cameras,
        SampledSurface(samples.points, samples.normals),
        claims.measured_by,
        requirements.camera.max_incidence,
    )
    if partial.request.ranges is None:
        return tuple(rows)
    body, guard = partial.request.ranges
    return with_spread(rows, devices.cameras, body.ball, guard)
