"""What every part of the audit looks at: the plan, and what was recomputed of it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate
from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.model.document.input_records import ModelRecord
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import (
    Reachable,
    Recomputed,
    reachable_by,
    recompute,
)

from .audit_samples import AuditSamples, draw_samples
from .estimates import Estimator


@dataclass(frozen=True, eq=False)
class DeviceKind:
    """What a plan says of its projectors, or of its cameras.

    Attributes:
        name: `projector` or `camera`.
        records: As written in the plan.
        devices: As built from the records.
        model: Of the rig.
        proof: Their certificate.
        most: How many are allowed; None: as many as it takes.
        covers: Whether each lights or measures each sample, shape (n_d, n).
        reachable_m2: Claimed area of the target that they could cover.
        share: Of it that must be covered.
        poses: Of the reference set, shape (n, 4, 4).
        n_poses: How many of these are claimed.
        shell: Least and largest distance from the centre of the workspace [m].
        standoff_m: Of tiled placement; None without.
    """

    name: str
    records: tuple[ProjectorRecord, ...] | tuple[CameraRecord, ...]
    devices: tuple[PlannedProjector, ...] | tuple[PlannedCamera, ...]
    model: ModelRecord
    proof: Certificate
    most: int | None
    covers: NDArray[np.bool_]
    reachable_m2: float
    share: float
    poses: NDArray[np.float64]
    n_poses: int
    shell: tuple[float, float]
    standoff_m: float | None


@dataclass(frozen=True, eq=False)
class AuditCase:
    """A plan and the audit's figures of it.

    Attributes:
        plan: The plan, as written.
        shadow: Its surface, as rays meet it.
        actual: What its devices do to the audit's samples.
        reachable: What reference poses could do.
        estimator: Areas from these samples.
        seed: Of every random draw.
    """

    plan: RigPlan
    shadow: Shadow
    actual: Recomputed
    reachable: Reachable
    estimator: Estimator
    seed: int

    @property
    def samples(self) -> AuditSamples:
        """The audit's samples."""
        return self.actual.samples

    @cached_property
    def projectors(self) -> tuple[AuditProjector, ...]:
        """The plan's projectors."""
        return audit_projectors(self.plan)

    @cached_property
    def cameras(self) -> tuple[AuditCamera, ...]:
        """The plan's cameras."""
        return audit_cameras(self.plan)

    @cached_property
    def kinds(self) -> tuple[DeviceKind, DeviceKind]:
        """What the plan says of its projectors, then of its cameras."""
        plan, limits = self.plan, self.plan.requirements
        document, areas, space = plan.document, plan.coverage.target, limits.workspace
        return (
            DeviceKind(
                "projector",
                document.projectors,
                plan.projectors,
                document.rig.projector,
                document.certificates.projectors,
                limits.max_projectors,
                self.actual.lit_by,
                areas.reachable_by_projectors_m2,
                limits.dominant_coverage,
                plan.surface.reference_projectors,
                space.n_reference_projectors,
                space.projector_radius_m,
                space.projector_standoff_m,
            ),
            DeviceKind(
                "camera",
                document.cameras,
                plan.cameras,
                document.rig.camera,
                document.certificates.cameras,
                limits.max_cameras,
                self.actual.measured_by,
                areas.reachable_by_cameras_m2,
                limits.coverage,
                plan.surface.reference_cameras,
                space.n_reference_cameras,
                space.camera_radius_m,
                space.camera_standoff_m,
            ),
        )


def examine(plan: RigPlan, *, seed: int, n_samples: int, threads: int) -> AuditCase:
    """Recompute what a plan's devices and reference poses do to fresh samples."""
    target = plan.requirements.target
    samples = draw_samples(plan.surface, target, n_samples, seed)
    shadow = Shadow.of(plan, threads=threads)
    actual = recompute(plan, samples, shadow)
    areas = plan.surface.mesh.face_areas
    inside = plan.surface.target_faces(target)
    claimed = plan.coverage.samples
    estimator = Estimator(
        samples, claimed, float(areas.sum()), float(areas[inside].sum())
    )
    reachable = reachable_by(plan, actual, shadow, seed)
    return AuditCase(plan, shadow, actual, reachable, estimator, seed)
