"""What two cameras measure of each sample by each other's images, and how exactly.

A point P that is off by dP moves in image i by A_i dP, A_i = d pixel / dP of shape
(2, 3). Of pixels that are off by e_i, each axis by s_0, the least squares take::

    dP = M^-1 sum_i A_i^T e_i,    M = sum_i A_i^T A_i

so that with h_i = A_i M^-1 N the point moves along the normal by sum_i h_i.e_i.
An error of a calibration is one of pixels, too: a turn by d about the optical centre O
moves them by A_i (d x (P - O)), a displacement by A_i of it, the focal length by its
share of what they are off the principal point, and that point by itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints, cross
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.requirements import TriangulationLimits
from planning.verify.audit.audit_samples import AuditSamples

from .audit_devices import AuditCamera
from .audit_optics import dot, in_frame, in_world, pixels_of, towards
from .predicates import LIGHT_CAUSES, PAIR_CAUSES, SIGHT_CAUSES

# Of the distance: central differences of this step are exact to a billionth.
_STEP = 1e-5
VIEW_CAUSES = ("few_views", "view_angle", "view_sigma")
# What holds samples back, by one number each.
CAUSES = LIGHT_CAUSES + SIGHT_CAUSES + PAIR_CAUSES + VIEW_CAUSES
# Limits of pairs: all but the number of views.
GOOD = len(VIEW_CAUSES) - 1


@dataclass(frozen=True, eq=False)
class Sighted:
    """How a camera sees n samples.

    Attributes:
        rays: Unit vectors towards them, shape (n, 3).
        offsets: From the optical centre, shape (n, 3) [m].
        shifts: A, shape (n, 2, 3) [px/m].
        off_centre: Pixels from the principal point, shape (n, 2).
    """

    rays: Array
    offsets: Array
    shifts: Array
    off_centre: Array

    @classmethod
    def of(cls, camera: AuditCamera, samples: AuditSamples) -> "Sighted":
        """Look at samples that the camera sees."""
        pose, device = camera.world_from_device, camera.device
        rays, distance = towards(samples.points, pose[:3, 3])
        local = in_frame(pose, samples.points)
        shifts = np.empty((len(samples), 2, 3))
        step = _STEP * distance[:, None]
        for axis in np.eye(3):
            ahead, behind = (pixels_of(device, local + s * axis) for s in (step, -step))
            shifts[:, :, int(np.argmax(axis))] = (ahead - behind) / (2.0 * step)
        shifts = in_world(pose, shifts.reshape(-1, 3)).reshape(shifts.shape)
        off_centre = pixels_of(device, local) - device.camera_matrix[:2, 2]
        return cls(rays, samples.points - pose[:3, 3], shifts, off_centre)

    def take(self, chosen: Ints) -> "Sighted":
        """Return some of the samples."""
        return Sighted(*(column[chosen] for column in vars(self).values()))


def met_angle(one: Sighted, other: Sighted) -> Array:
    """Return the angle between the rays of two cameras [rad], (n,)."""
    sine = np.linalg.norm(cross(one.rays, other.rays), axis=1)
    return np.arctan2(sine, dot(one.rays, other.rays))


def view_terms(
    one: Sighted, other: Sighted, normals: Array, limits: TriangulationLimits
) -> dict[str, Array]:
    """Return independent parts of the deviation along the normal [m], (n,) each."""
    both = np.concatenate([one.shifts, other.shifts], axis=1)
    normal_matrix = np.swapaxes(both, 1, 2) @ both
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = _solved(normal_matrix, normals)
    h = np.einsum("nij,nj->ni", both, moved)
    terms = {"matches": limits.noise_px * np.linalg.norm(h, axis=1)}
    if limits.calibration is not None:
        a, b = (
            _calibration_variance(limits.calibration, view, part)
            for view, part in ((one, h[:, :2]), (other, h[:, 2:]))
        )
        terms["camera"] = np.sqrt(a + b)
    return terms


def pair_passes(
    one: Sighted, other: Sighted, normals: Array, limits: TriangulationLimits
) -> NDArray[np.int8]:
    """Return how many limits of pairs hold before the first that doesn't, int8 (n,)."""
    met = met_angle(one, other)
    low, high = limits.min_angle or 0.0, limits.max_angle or np.pi
    between = (met >= low) & (met <= high)
    passes = between.astype(np.int8)
    terms = view_terms(one, other, normals, limits)
    named = ["matches"] if limits.accuracy_of == "noise" else list(terms)
    sigma = np.sqrt(sum(terms[name] ** 2 for name in named))
    most = np.inf if limits.max_sigma_m is None else limits.max_sigma_m
    return passes + (between & (sigma <= most)).astype(np.int8)


def _solved(matrices: Array, vectors: Array) -> Array:
    """Return M^-1 v, (n, 3); infinite where M has no inverse."""
    values, axes = np.linalg.eigh(matrices)
    along = np.einsum("nij,ni->nj", axes, vectors)
    flat = values <= 1e-12 * values[:, -1:]
    scaled = np.where(flat, np.inf * (along != 0.0), along / np.where(flat, 1, values))
    scaled = np.where(np.isnan(scaled), 0.0, scaled)
    return np.einsum("nij,nj->ni", axes, scaled)


def _calibration_variance(errors: CalibrationErrors, view: Sighted, h: Array) -> Array:
    """Return the variance along the normal that a camera's errors leave [m^2], (n,)."""
    pulled = np.einsum("nij,ni->nj", view.shifts, h)
    turned = cross(view.offsets, pulled)
    return (
        errors.angle**2 / 3.0 * dot(turned, turned)
        + errors.position_m**2 / 3.0 * dot(pulled, pulled)
        + errors.focal**2 * dot(h, view.off_centre) ** 2
        + errors.principal_px**2 / 2.0 * dot(h, h)
    )
