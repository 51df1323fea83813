"""What every part of the audit looks at: the plan, and what was recomputed of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Mask
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import Certificate
from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.model.document.input_records import ModelRecord
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.examined import what_any_could, what_devices_do
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import Reachable, Recomputed

from .audit_samples import AuditSamples, draw_samples
from .estimates import Estimator

# Of the target, drawn afresh.
N_SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class DeviceKind:
    """What a plan says of its projectors, or of its cameras.

    Attributes:
        name: `projector` or `camera`.
        records: As written in the plan; `devices` are built from them.
        models: Of the rig, the first one first.
        proof: Their certificate.
        most: How many are allowed; None: as many as it takes.
        covers: Whether each lights or measures each sample, shape (n_d, n).
        covered_with: Return what some of them light or measure, shape (n,).
        coverable: Whether anything could, shape (n,).
        reachable_m2: Claimed area of the target that they could cover.
        share: Of it that must be covered.
        poses: Of the reference set, shape (n, 4, 4); `n_poses` are claimed.
        shell: Least and largest distance from the centre of the workspace [m].
    """

    name: str
    records: tuple[ProjectorRecord, ...] | tuple[CameraRecord, ...]
    devices: tuple[PlannedProjector, ...] | tuple[PlannedCamera, ...]
    models: tuple[ModelRecord, ...]
    proof: Certificate
    most: int | None
    covers: Mask
    covered_with: Callable[[list[int]], Mask]
    coverable: Mask
    reachable_m2: float
    share: float
    poses: Array
    n_poses: int
    shell: tuple[float, float]

    @property
    def is_counted(self) -> bool:
        """Whether there are several models, and so many of one."""
        return len(self.models) > 1 and any(model.count for model in self.models)


@dataclass(frozen=True, eq=False)
class AuditCase:
    """A plan and the audit's figures of it.

    Attributes:
        shadow: Its surface, as rays meet it.
        actual: What its devices do to the audit's samples.
        seed: Of every random draw.
    """

    plan: RigPlan
    shadow: Shadow
    actual: Recomputed
    estimator: Estimator
    seed: int

    @property
    def samples(self) -> AuditSamples:
        """Fresh ones."""
        return self.actual.samples

    @cached_property
    def reachable(self) -> Reachable:
        """What reference poses could do, which pixels needn't wait for."""
        return what_any_could(self.plan, self.actual, self.shadow, self.seed)

    def drawn_again(self, times: int) -> "AuditCase":
        """Return the same of other samples, so many times as many."""
        limits, n = self.plan.requirements, times * len(self.samples)
        surface = self.plan.surface
        samples = draw_samples(surface, limits.target, n, self.seed, again=True)
        return replace(
            self,
            actual=what_devices_do(self.plan, samples, self.shadow),
            estimator=replace(self.estimator, samples=samples),
        )

    @cached_property
    def projectors(self) -> tuple[AuditProjector, ...]:
        """The plan's projectors."""
        return audit_projectors(self.plan)

    @cached_property
    def cameras(self) -> tuple[AuditCamera, ...]:
        """The plan's cameras."""
        return audit_cameras(self.plan)

    @cached_property
    def large_regions(self) -> set[int]:
        """Numbers of the regions that a floor is for."""
        surface, limits = self.plan.surface, self.plan.requirements
        areas = surface.mesh.face_areas
        least = limits.region_share * areas[surface.target_faces(limits.target)].sum()
        return {
            int(number)
            for number in np.unique(surface.region[surface.in_dominant])
            if areas[surface.region == number].sum() >= least * (1.0 - 1e-9)
        }

    @cached_property
    def kinds(self) -> tuple[DeviceKind, ...]:
        """What the plan says of its projectors, then of its cameras.

        Of cameras alone there is but one kind.
        """
        limits, lit_by = self.plan.requirements, self.actual.lit_by
        cameras = self._kind(
            "camera",
            self.actual.measured_by,
            limits.coverage,
            self.actual.measured_with,
        )
        if limits.pattern == "none":
            return (cameras,)

        def lit_with(projectors: list[int]) -> Mask:
            return np.any(lit_by[projectors], axis=0)

        share = limits.dominant_coverage
        return self._kind("projector", lit_by, share, lit_with), cameras

    def _kind(
        self,
        name: str,
        covers: Mask,
        share: float,
        covered_with: Callable[[list[int]], Mask],
    ) -> DeviceKind:
        plan, document, limits = self.plan, self.plan.document, self.plan.requirements
        return DeviceKind(
            name=name,
            records=getattr(document, f"{name}s"),
            devices=getattr(plan, f"{name}s"),
            models=document.rig.models(name),
            proof=getattr(document.certificates, f"{name}s"),
            most=getattr(limits, f"max_{name}s"),
            covers=covers,
            covered_with=covered_with,
            coverable=getattr(self.reachable, f"{name}s"),
            reachable_m2=getattr(plan.coverage.target, f"reachable_by_{name}s_m2"),
            share=share,
            poses=getattr(plan.surface, f"reference_{name}s"),
            n_poses=getattr(limits.workspace, f"n_reference_{name}s"),
            shell=getattr(limits.workspace, f"{name}_radius_m"),
        )


def examine(
    plan: RigPlan, *, seed: int, threads: int, n_samples: int = N_SAMPLES
) -> AuditCase:
    """Recompute what a plan's devices do to fresh samples.

    Raises:
        PlanFileError: If there is no device of a kind that the pattern takes.
    """
    kinds = ("cameras",) if plan.cameras_alone else ("projectors", "cameras")
    for kind in kinds:
        if not getattr(plan, kind):
            raise PlanFileError(f"{kind} = []: nothing can be verified; plan again")
    samples = draw_samples(plan.surface, plan.requirements.target, n_samples, seed)
    shadow = Shadow.of(plan, threads=threads)
    actual = what_devices_do(plan, samples, shadow)
    areas = plan.surface.mesh.face_areas
    target_m2 = areas[plan.surface.target_faces(plan.requirements.target)].sum()
    estimator = Estimator(
        samples, plan.coverage.samples, float(areas.sum()), float(target_m2)
    )
    return AuditCase(plan, shadow, actual, estimator, seed)
