"""A rig as the simulated reconstruction takes it: devices, limits and the object."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.bodies import Obstacle
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.devices.planned import PlannedProjector
from planning.model.errors import InputError
from planning.model.light.light_budget import LightBudget
from planning.model.plan import RigPlan
from planning.model.requirements import CheckLimits
from planning.verify.reconstruction.patterns.response import Response
from planning.verify.reconstruction.patterns.ring_patterns import Frame

from .arrays import Array, Indices, Mask
from .calibration import (
    CameraCalibration,
    PairCalibration,
    ProjectorCalibration,
    calibrate_camera,
    calibrate_projector,
)
from .decode.dense.dense_limits import DenseLimits
from .patterns.defocus import Defocus, defocus_of

# Rings that run more steeply along the viewing ray cross steps between surfaces, unless
# the plan counts on surface seen at such incidence [rad].
_SLANTED = np.deg2rad(65.0)
_SLANT_MARGIN = np.deg2rad(5.0)
# Points of coded pixels are made this share of tau apart on the object.
_SPACING = 0.25


@dataclass(frozen=True)
class ScanLimits:
    """What is asked of a scanner.

    Attributes:
        check: What the measured points must reach.
        min_conditioning: Least |r.m| of a point.
        max_lit: Largest incidence of light that counts [rad].
        max_seen: Largest incidence at a camera that counts [rad].
        max_sigma_m: Largest standard deviation of a point that counts [m].
        min_angle: Least triangulation angle of points of coded pixels [rad].
        max_angle: Largest of these [rad].
    """

    check: CheckLimits
    min_conditioning: float
    max_lit: float
    max_seen: float
    max_sigma_m: float = np.inf
    min_angle: float | None = None
    max_angle: float | None = None

    @property
    def _max_slant(self) -> float:
        return float(np.tan(max(self.max_seen - _SLANT_MARGIN, _SLANTED)))

    @property
    def decoder(self) -> dict[str, float]:
        """Limits that `decode` takes."""
        return {
            "min_conditioning": self.min_conditioning,
            "max_slant": self._max_slant,
        }

    @property
    def dense(self) -> DenseLimits:
        """Limits that `decode_dense` takes.

        Points vaguer than half of tau say nothing of what lies within tau.
        """
        tau = self.check.tau_m
        return DenseLimits(
            min_angle=0.0 if self.min_angle is None else self.min_angle,
            max_angle=np.pi if self.max_angle is None else self.max_angle,
            max_slant=self._max_slant,
            max_sigma_m=min(0.5 * tau, self.max_sigma_m),
            spacing_m=_SPACING * tau,
        )


@dataclass(frozen=True)
class BaselineLimit:
    """The distance of two cameras, and the largest that eq. (10) allows [m]."""

    cameras: frozenset[str]
    d: float
    d_max: float


@dataclass(frozen=True, eq=False)
class Scanner:
    """Devices as they are planned, or stand, about an object.

    Attributes:
        projectors: In the order of the plan.
        cameras: Likewise.
        mesh: The object.
        region: Dominant region of each face, -1 for none, shape (n_f,).
        target: Faces that are to be measured, shape (n_f,).
        limits: What is asked.
        projector_focus: How the projectors are focused; None: unknown.
        groups: Ids of the projectors that shine at the same time.
        baselines: Of pairs of cameras that eq. (10) limits.
        obstacles: What stands about the object and isn't a device.
        digest: Of the plan; empty where there is none.
        calibration: What its calibration leaves of each device; None: nobody says.
        covariance: What an adjustment leaves of all devices instead, (9 n, 9 n): of
            each camera, then of each projector, its turn about and displacement along
            its axes [rad], [m], its focal length as a share, its principal point [px].
        light: What reaches the sensors; None: nobody says.
        exposures: Ids of projectors with what their frames are exposed for [s].
    """

    projectors: tuple[ProjectorCalibration, ...]
    cameras: tuple[CameraCalibration, ...]
    mesh: TriangleMesh
    region: Indices
    target: Mask
    limits: ScanLimits
    projector_focus: Defocus | None = None
    groups: tuple[frozenset[str], ...] = ()
    baselines: tuple[BaselineLimit, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    digest: str = ""
    calibration: CalibrationErrors | None = None
    covariance: Array | None = None
    light: LightBudget | None = None
    exposures: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, plan: RigPlan) -> Self:
        """Return what a plan says."""
        document, wanted = plan.document, plan.requirements
        schedule = document.firing_schedule
        return cls(
            tuple(_projector(plan, projector) for projector in plan.projectors),
            tuple(
                replace(
                    calibrate_camera(camera),
                    focus=defocus_of(document.rig.model_of("camera", camera.model)),
                )
                for camera in plan.cameras
            ),
            plan.surface.mesh,
            plan.surface.region,
            plan.surface.target_faces(wanted.target),
            ScanLimits(
                wanted.check,
                wanted.triangulation.min_conditioning,
                wanted.projector.max_incidence,
                wanted.camera.max_incidence,
                wanted.triangulation.max_sigma_m or np.inf,
                wanted.triangulation.min_angle,
                wanted.triangulation.max_angle,
            ),
            defocus_of(document.rig.projector),
            tuple(frozenset(group) for group in (schedule.groups if schedule else ())),
            tuple(
                BaselineLimit(frozenset(row.cameras), row.d, row.d_max)
                for row in document.baselines
                if row.d_max is not None
            ),
            plan.surface.obstacles,
            plan.digest,
            wanted.triangulation.calibration,
            light=wanted.triangulation.light,
            exposures=tuple((p.id, p.exposure_s or 0.0) for p in plan.projectors),
        )

    def pairs(self) -> Iterator[tuple[tuple[int, int], PairCalibration]]:
        """Yield the indices of projector and camera and both, camera by camera.

        Of those that stand at one station, or of which either stands at none.
        """
        for c, camera in enumerate(self.cameras):
            for p, projector in enumerate(self.projectors):
                if camera.station == projector.station or not (
                    camera.station and projector.station
                ):
                    yield (p, c), PairCalibration(projector, camera)

    def name(self, pair: tuple[int, int]) -> str:
        """Return what a pair is called."""
        p, c = pair
        return f"{self.projectors[p].id} with {self.cameras[c].id}"

    def frames(self, p: int) -> tuple[Frame, ...]:
        """Return what a projector shows for all cameras, in order."""
        projector = self.projectors[p]
        if projector.dense is not None:
            return projector.dense.frames
        return projector.pattern.frames(camera.id for camera in self.cameras)

    @property
    def is_dense(self) -> bool:
        """Whether some projector codes its pixels."""
        return any(projector.dense is not None for projector in self.projectors)

    def require_rings(self, what: str) -> None:
        """Refuse what is made for rings alone.

        Raises:
            InputError: If some projector codes its pixels.
        """
        if self.is_dense:
            raise InputError(
                f"{what} is of ring patterns, and this plan's pattern is dense; leave "
                f"it out, or plan with --pattern rings"
            )

    def frame_names(self, p: int, c: int) -> tuple[str, ...]:
        """Return the names of the frames that a camera's decoder reads, in order."""
        seen = (None, self.cameras[c].id)
        return tuple(frame.name for frame in self.frames(p) if frame.camera in seen)

    def shining_with(self, projector: str) -> frozenset[str]:
        """Return the other projectors that shine at the same time as one."""
        together = (group for group in self.groups if projector in group)
        return next(together, frozenset()) - {projector}


def _projector(plan: RigPlan, projector: PlannedProjector) -> ProjectorCalibration:
    model = plan.document.rig.model_of("projector", projector.model)
    response = Response(model.figures.response or 1.0)
    return replace(calibrate_projector(projector), response=response)
