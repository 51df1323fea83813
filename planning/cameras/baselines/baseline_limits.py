"""What binds a camera whose baselines grow, and what rings ask of it on samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from planning.model.devices.calibration_errors import PERFECT, CalibrationErrors
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import Workspace
from planning.scene.limits.calibration_terms import calibration_px

from .seams import SampledSurface

_Array = NDArray[np.float64]

# Proposals stay by this share inside what rings ask.
_SPARE_RINGS = 0.002


@dataclass(frozen=True, eq=False)
class BaselineLimits:
    """What binds a camera whose baselines grow.

    Attributes:
        max_incidence: theta in [rad].
        min_conditioning: Least |r.m|.
        workspace: Where cameras may stand.
        min_ring_pitch_px: Least distance of neighbouring rings in the image [px].
        max_sigma_m: Largest standard deviation along the normal [m].
        spare_field: What seams keep free of the half fields [rad], at least that by
            which proposals stay inside their limits.
        calibration: What the calibration leaves of a camera.
    """

    max_incidence: float
    min_conditioning: float
    workspace: Workspace
    min_ring_pitch_px: float | None = None
    max_sigma_m: float | None = None
    spare_field: float = 0.0
    calibration: CalibrationErrors = PERFECT


@dataclass(frozen=True, eq=False)
class RingsOnSurface:
    """The rings of every projector on n samples.

    Attributes:
        normals: Unit normals m of the ring surfaces, shape (n_p, n, 3).
        spacing: h, ring spacing along m in [m], shape (n_p, n).
        noise_px: s_px, edge noise in [px], shape (n_p, n).
        lit: Whether a projector lights a sample, shape (n, n_p).
        placed: Standard deviation of the ring surfaces along m [m], shape (n_p, n);
            0: as drawn.
        turning: Whether `normals` are instead the directions of the light on coded
            pixels, where m is that part of a ray across it.
    """

    normals: _Array
    spacing: _Array
    noise_px: _Array
    lit: NDArray[np.bool_]
    placed: _Array | float = 0.0
    turning: bool = False

    def across(self, samples: NDArray[np.int64], rays: _Array) -> _Array:
        """Return m of the surfaces by which rays (q, 3) measure them, (n_p, q, 3)."""
        normals = self.normals[:, samples]
        if not self.turning:
            return normals
        along = np.einsum("ij,pij->pi", rays, normals)
        m = rays - along[..., None] * normals
        return m / np.maximum(lengths(m), 1e-12)[..., None]


def best_rings(
    camera: PlannedCamera,
    samples: NDArray[np.int64],
    surface: SampledSurface,
    rings: RingsOnSurface,
    limits: BaselineLimits,
) -> tuple[_Array, _Array, _Array, _Array]:
    """Return the ring normals that measure samples best, and what s_N and pitch ask.

    With g = J_r^T v, |g| = c |v| / f, where c is 1 on the optical axis and hardly
    changes as the camera moves; so the limits become m.r >= q t |v| and
    -N.r >= p t |v| with q = s_px c / (f max_sigma) and p = min_pitch c / (h f), where
    s_px c / f holds also what the calibration leaves, as it is at this pose.

    Returns:
        Ring normals with m.r > 0, (q, 3); q and p in [1/m], 0 where the limit doesn't
        bind; what the tightest of these limits leaves, in units of a cosine; (q,) each.
    """
    pose = camera.world_from_device
    ray = surface.points[samples] - pose[:3, 3]
    distance = lengths(ray)
    r, normal = ray / distance[:, None], surface.normals[samples]
    m = rings.across(samples, r)
    along = np.einsum("ij,pij->pi", r, m)
    facing = -np.einsum("ij,ij->i", r, normal)
    v = normal * along[..., None] + m * facing[:, None]
    jacobian = pose[:3, :3] @ camera.device.ray_jacobian(ray @ pose[:3, :3])
    g = lengths(np.einsum("ijk,pij->pik", jacobian, v))
    per_length = g / np.maximum(lengths(v), 1e-9)
    reach = np.maximum(distance * lengths(v), 1e-12)
    placed = np.broadcast_to(rings.placed, rings.spacing.shape)[:, samples]
    turned = calibration_px(limits.calibration, distance, per_length)
    edge = per_length * np.hypot(rings.noise_px[:, samples], turned)
    sigma = np.hypot(edge, placed * facing / reach) / (limits.max_sigma_m or np.inf)
    pitch = (limits.min_ring_pitch_px or 0.0) * per_length / rings.spacing[:, samples]
    spare = np.minimum(
        np.abs(along) - np.maximum(limits.min_conditioning, sigma * reach),
        facing - pitch * reach,
    )
    best = np.argmax(np.where(rings.lit[samples].T, spare, -np.inf), axis=0)
    each = np.arange(len(samples))
    sign = np.where(along[best, each] < 0.0, -1.0, 1.0)
    spared = 1.0 + _SPARE_RINGS
    return (
        sign[:, None] * m[best, each],
        spared * sigma[best, each],
        spared * pitch[best, each],
        spare[best, each],
    )
