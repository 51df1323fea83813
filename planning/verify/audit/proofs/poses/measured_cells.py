"""Which samples a camera anywhere in a cell may measure with a plan's projectors.

A superset, however the camera is aimed and rolled: field of view, light and bodies are
left out. Seen within psi of u, no nearer than t; m is the normal of the rings at the
sample, w = N x m, and the image moves by no less than q times what a ray turns by::

    |m.r| <= cos(angle(u, line of m) - psi)                                  crossing
    |N.r| <= cos(angle(u, N) - psi),   |N.r| >= cos(angle(u, N) + psi)
    |w x r| >= |w| sin(angle(u, line of w) - psi)                            turned
    an error of a ray by d moves the point by d |w x r| / |m.r| along N, and of the
    rings by d |N.r| / |m.r|;   rings are h |N.r| / (t q |w x r|) apart in the image

Of coded pixels m turns with r: there only the angle between ray and light is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Mask, cross
from geometry.devices import PinholeModel
from planning.model.requirements import Requirements, TriangulationLimits
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import dot, in_frame

from .admissible_cells import may_stand
from .skies import Skies
from .sphere_cells import Cells, seen_from

_ROUNDING = 1e-9
# The audit differentiates its projection by differences.
_DIFFERENCES = 1e-6
_RIGHT = 0.5 * np.pi


@dataclass(frozen=True)
class Lens:
    """What holds anywhere in the image of any model of the cameras.

    Attributes:
        focal_px: Largest geometric mean of the focal lengths.
        off_axis: Largest angle to the optical axis [rad].
        least_turn: Least shift in the image by a turn of a ray, q [px].
    """

    focal_px: float
    off_axis: float
    least_turn: float

    @classmethod
    def of(cls, devices: Sequence[PinholeModel]) -> "Lens":
        """Return what holds of all; of bent images, that nothing is known."""
        focals = [np.diag(device.camera_matrix)[:2] for device in devices]
        focal = max(float(np.sqrt(np.prod(both))) for both in focals)
        if any(any(device.distortion) for device in devices):
            return cls(focal, _RIGHT, 0.0)
        off = max(_farthest_corner(device) for device in devices)
        longest = max(float(both.max()) for both in focals)
        return cls(focal, off, np.cos(off) ** 2 / longest * (1.0 - _ROUNDING))


def _farthest_corner(device: PinholeModel) -> float:
    width, height = device.resolution
    corners = np.array(
        [[u, v] for u in (-0.5, width - 0.5) for v in (-0.5, height - 0.5)]
    )
    focal = np.diag(device.camera_matrix)[:2]
    slopes = (corners - device.camera_matrix[:2, 2]) / focal
    return float(np.arctan(np.linalg.norm(slopes, axis=1).max()))


@dataclass(frozen=True, eq=False)
class LitBy:
    """What one projector offers at each sample.

    Attributes:
        lit: Samples that it lights, (n,).
        m: Unit normals of its rings, (n, 3); with coded pixels its light, from the
            projector.
        coded: Whether its pixels are coded.
        width: |N x m|, (n,); `line` is its unit vector, (n, 3).
        spacing_m: How far rings are apart along m, (n,).
        noise_px: Least noise of an edge in the image, (n,).
        placed_m: Least error of a ring along m, (n,).
    """

    lit: Mask
    m: Array
    coded: bool
    width: Array
    line: Array
    spacing_m: Array
    noise_px: Array
    placed_m: Array

    @classmethod
    def of(
        cls,
        projector: AuditProjector,
        samples: AuditSamples,
        lit: Mask,
        limits: TriangulationLimits,
    ) -> "LitBy":
        """Look at samples with a projector of the plan."""
        points, normals = samples.points, samples.normals
        light, _ = projector.light.to_points(points)
        none = np.zeros(len(points))
        if projector.code is not None:
            return cls(lit, np.array(light), True, none, normals, none, none, none)
        m = projector.ring_gradient(points)
        m = m / np.linalg.norm(m, axis=1)[:, None]
        line = cross(normals, m)
        width = np.linalg.norm(line, axis=1)
        line = line / np.where(width > 0.0, width, 1.0)[:, None]
        noise = limits.noise_px / np.maximum(-dot(normals, light), _ROUNDING)
        placed = np.hypot(
            _moved(projector, points, m, limits), limits.ring_sigma_m or 0.0
        )
        spacing = projector.ring_spacing(points)
        return cls(lit, m, False, width, line, spacing, noise, placed)


def _moved(
    projector: AuditProjector, points: Array, m: Array, limits: TriangulationLimits
) -> Array:
    """Return what the calibration of a projector leaves of its rings along m [m]."""
    errors = limits.calibration
    if errors is None or limits.accuracy_of != "total":
        return np.zeros(len(points))
    pose = projector.world_from_device
    longer, per_px = projector.light.panel_shifts(
        in_frame(pose, points), m @ pose[:3, :3]
    )
    turned = np.linalg.norm(cross(points - pose[:3, 3], m), axis=1)
    return np.sqrt(
        (errors.angle**2 * turned**2 + errors.position_m**2) / 3.0
        + (errors.focal * longer) ** 2
        + (errors.principal_px * per_px) ** 2 / 2.0
    )


@dataclass(frozen=True, eq=False)
class MeasuredCells:
    """Cells of cameras.

    Attributes:
        required: Limits, and where cameras may stand.
        samples: What they may measure.
        lit_by: By each projector.
        lens: Of all models.
        range_m: Least and largest distance of any model [m].
        skies: Directions from which nothing is seen; None: it isn't asked.
    """

    required: Requirements
    samples: AuditSamples
    lit_by: Sequence[LitBy]
    lens: Lens
    range_m: tuple[float, float]
    skies: Skies | None

    def serve(self, cells: Cells, may: Mask) -> Mask:
        """Return which samples poses of each cell may measure, of those that may be."""
        space, normals = self.required.workspace, self.samples.normals
        points = self.samples.points - np.array(space.centre)
        lines = [line for one in self.lit_by for line in (one.m, one.line)]
        seen = seen_from(cells, points, (normals, *lines))
        angles = [np.arccos(np.clip(c, -1.0, 1.0)) for c in seen.along]
        psi, incidence = seen.psi, angles[0]
        facing = np.cos(np.clip(incidence - psi, 0.0, np.pi))
        limits, (near, far) = self.required.camera, self.range_m
        finest = limits.max_sample_distance_m
        served = (
            may
            & may_stand(space, cells)[:, None]
            & (incidence - psi <= limits.max_incidence + _ROUNDING)
            & (seen.nearest <= far + _ROUNDING)
            & (seen.farthest >= near - _ROUNDING)
        )
        if finest is not None:
            depth = seen.nearest * np.cos(self.lens.off_axis)
            served &= depth <= finest * self.lens.focal_px * facing + _ROUNDING
        squarely = np.cos(np.minimum(incidence + psi, limits.max_incidence))
        paired = np.zeros_like(served)
        for p, one in enumerate(self.lit_by):
            m, line = angles[2 * p + 1], angles[2 * p + 2]
            if one.coded:
                paired |= one.lit & self._coded(m, psi)
                continue
            turned = one.width * np.sin(np.clip(_off_line(line) - psi, 0.0, _RIGHT))
            crossing = np.cos(np.clip(_off_line(m) - psi, 0.0, _RIGHT))
            view = crossing, turned, seen.nearest, facing, squarely
            paired |= one.lit & self._ringed(one, *view)
        served &= paired
        if self.skies is not None:
            self.skies.leave_open(served, cells, psi, points)
        return served

    def _coded(self, angle: Array, psi: Array) -> Mask:
        """Whether the angle between ray and light may be as asked; it is to -u."""
        least, most = self.required.triangulation.angles
        met = np.pi - angle
        return (met + psi >= least - _ROUNDING) & (met - psi <= most + _ROUNDING)

    def _ringed(
        self,
        one: LitBy,
        crossing: Array,
        turned: Array,
        nearest: Array,
        facing: Array,
        squarely: Array,
    ) -> Mask:
        limits = self.required.triangulation
        held = crossing >= limits.min_conditioning - _ROUNDING
        shift = nearest * turned * self.lens.least_turn
        if limits.min_ring_pitch_px is not None:
            least = shift * limits.min_ring_pitch_px * (1.0 - _DIFFERENCES)
            held &= least <= one.spacing_m * facing
        if limits.max_sigma_m is not None:
            errors, by_ray = limits.calibration, 0.0
            if errors is not None and limits.accuracy_of == "total":
                by_ray = (errors.angle**2 * nearest**2 + errors.position_m**2) / 3.0
            square = (one.noise_px * shift) ** 2 + by_ray * turned**2
            square = square + (one.placed_m * squarely) ** 2
            most = limits.max_sigma_m * crossing * (1.0 + _DIFFERENCES)
            held &= square <= most**2
        return held


def _off_line(angle: Array) -> Array:
    """Return the angle to a line of which one direction is at an angle."""
    return np.minimum(angle, np.pi - angle)
