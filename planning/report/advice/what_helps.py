"""What would help a plan that misses a requirement, written beside what it misses."""

from contextlib import AbstractContextManager

from planning.model.document.certificates import Certificate, Certificates
from planning.model.document.coverage_records import Coverage
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.report.partial_plan import PartialPlan

from .camera_relaxations import for_so_many, out_of_reach
from .projector_relaxations import reachability_relaxations, wider_field

# Share of reach from which on what mounts cost isn't worth telling.
_TOLD = 0.99


def with_relaxations(
    partial: PartialPlan, devices: Devices, claims: Claims, clock: Stopwatch
) -> Coverage:
    """Return the claims' coverage with what would let devices reach enough.

    Of mounts that can't be set to everything: with what that costs, too. Of heads and
    turntables only limits of projectors: cameras of the reference set have their own.
    """
    alone = partial.stationed is None
    coverage, areas = claims.coverage, claims.coverage.target
    least = _asked_reach(partial.scene.requirements, "projector")
    if falls_short(areas.reachable_by_projectors_m2, areas.area_m2, least):
        with _timed(clock):
            relaxations = reachability_relaxations(
                partial.scene, devices.reference_projectors, elsewhere=alone
            )
        coverage = coverage.changed(relaxations=relaxations)
    if alone and cameras_reach_too_little(partial.scene.requirements, coverage):
        with _timed(clock):
            causes, relaxations = out_of_reach(
                partial.scene, partial.request.rig, devices, claims
            )
        coverage = coverage.changed(
            unmeasurable_by_cause=causes, camera_relaxations=relaxations
        )
    return coverage


def with_fewer_needed(
    proofs: Certificates, partial: PartialPlan, clock: Stopwatch
) -> Certificates:
    """Return the certificates with what would let as many as are allowed be enough."""
    required = partial.scene.requirements
    projectors, cameras = proofs.projectors, proofs.cameras
    if projectors is not None and _too_few(projectors, required, "projector"):
        with _timed(clock):
            field = wider_field(partial.scene, partial.stage, required.max_projectors)
        if field is not None:
            needed = projectors.needed.changed(wider_field=field)
            proofs = proofs.changed(projectors=projectors.changed(needed=needed))
    if _too_few(cameras, required, "camera"):
        with _timed(clock):
            scene, count = partial.scene.among(partial.projectors), required.max_cameras
            changes = for_so_many(
                scene, partial.request.rig, partial.camera_stage, count or 0
            )
        if changes:
            needed = cameras.needed.changed(relaxations=changes)
            proofs = proofs.changed(cameras=cameras.changed(needed=needed))
    return proofs


def cameras_reach_too_little(required: Requirements, coverage: Coverage) -> bool:
    """Return whether it is said why cameras reach so little, and what would help."""
    areas, least = coverage.target, _asked_reach(required, "camera")
    return falls_short(areas.reachable_by_cameras_m2, areas.lit_m2, least)


def _asked_reach(required: Requirements, kind: str) -> float:
    """The share of reach below which it is said what would give more."""
    mount = required.workspace.mount_of(kind)
    told = _TOLD if mount is not None and mount.is_stepped else 0.0
    return max(required.min_reachable, told)


def falls_short(area_m2: float, whole_m2: float, share: float) -> bool:
    """Return whether an area is less than a share of another."""
    return area_m2 < share * whole_m2


def _too_few(proof: Certificate, required: Requirements, kind: str) -> bool:
    """Whether more are needed than are allowed; of a stock it is more that helps."""
    allowed = getattr(required, f"max_{kind}s")
    too_few = allowed is not None and proof.needed.count > allowed
    return too_few and not required.stock_of(kind)


def _timed(clock: Stopwatch) -> AbstractContextManager[None]:
    return clock.stage("relaxations", "what would help")
