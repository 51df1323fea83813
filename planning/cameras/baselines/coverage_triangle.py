"""Eqs. (9)-(10): how far apart two cameras may stand and still cover a seam.

E is where the parts of two cameras meet. In the triangle O1, E, O2::

    d_max^2 = D1^2 + D2^2 - 2 D1 D2 cos(phi_max)                              (9)
    covered <=> d'^2 < d_max^2 - d''^2 <=> d < d_max <=> phi < phi_max       (10)

(the last step for phi and phi_max in (0, pi); outside, the signed phi decides).
`docs/method/baselines.md` derives what stands here. Source: Lee and Krim, 2014, section
VI.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

# Below this, relative to the lengths involved, a direction counts as undefined.
_TINY = 1e-9
# A seam that runs this close to the plane O1, E, O2 (cosine) names no side there.
_UNDECIDED = 0.1


def largest_baseline(
    d1: _Array | float, d2: _Array | float, phi_max: _Array | float
) -> _Array:
    """Return d_max of eq. (9).

    Args:
        d1: D1 = |O1 E| in [m].
        d2: D2 = |O2 E| in [m].
        phi_max: Largest angle O1 E O2 at which both cameras reach E, in [rad].

    Returns:
        d_max in [m]; NaN where phi_max lies outside (0, pi): there no length of the
        baseline decides, and the signed phi has to be tested.
    """
    d1, d2, phi_max = (np.asarray(a, dtype=np.float64) for a in (d1, d2, phi_max))
    square = d1**2 + d2**2 - 2.0 * d1 * d2 * np.cos(phi_max)
    decides = (phi_max > 0.0) & (phi_max < np.pi)
    return np.where(decides, np.sqrt(np.maximum(square, 0.0)), np.nan)


def baseline_parts(
    centre1: _Array, axis1: _Array, centre2: _Array
) -> tuple[_Array, _Array]:
    """Return d' and d'', the lateral and axial parts of a baseline, eq. (10).

    With O the foot of O2 on camera 1's optical axis, d' = |O O2| and d'' = |O O1|.

    Args:
        centre1: O1 in [m], shape (..., 3).
        axis1: Camera 1's unit optical axis, shape (..., 3).
        centre2: O2 in [m], shape (..., 3).
    """
    baseline = np.asarray(centre2) - centre1
    axial = np.sum(baseline * axis1, axis=-1)
    lateral = np.linalg.norm(baseline - axial[..., None] * axis1, axis=-1)
    return lateral, np.abs(axial)


@dataclass(frozen=True, eq=False)
class SeamAngles:
    """The signed angles of formulation section 6 at n seam points, all in [rad].

    phi = beta_1 + delta_axes + beta_2 = iota_1 + delta_surface + iota_2. Angles are
    positive away from the other camera's stretch.

    Attributes:
        phi: Angle O1 E O2; negative where the sight lines cross, shape (n,).
        beta1: Off-axis angle of E in camera 1.
        beta2: Off-axis angle of E in camera 2.
        iota1: Incidence at E on camera 1's side of the seam.
        iota2: Incidence at E on camera 2's side of the seam.
        delta_axes: Turn from camera 1's optical axis to camera 2's.
        delta_surface: Turn of the surface at E, convex positive.
        outward: Unit direction of the surface normal in the plane, shape (n, 3).
        onward: Unit direction in the plane, square to `outward`, from camera 1's
            stretch into camera 2's, shape (n, 3).
    """

    phi: _Array
    beta1: _Array
    beta2: _Array
    iota1: _Array
    iota2: _Array
    delta_axes: _Array
    delta_surface: _Array
    outward: _Array
    onward: _Array

    def largest(self, half_field2: _Array, max_incidence2: float | _Array) -> _Array:
        """Return phi_max, camera 1 held at the end of its coverage.

        ::

            phi_max = min(beta_1 + delta_axes + b_2, iota_1 + delta_surface + theta_2)

        Args:
            half_field2: b_2, half field of camera 2 beyond E in the plane [rad].
            max_incidence2: theta_2, incidence that camera 2 accepts [rad].
        """
        return np.minimum(
            self.beta1 + self.delta_axes + half_field2,
            self.iota1 + self.delta_surface + max_incidence2,
        )


def seam_angles(
    points: _Array,
    onward: _Array,
    *,
    centres: tuple[_Array, _Array],
    axes: tuple[_Array, _Array],
    normals: tuple[_Array, _Array],
) -> SeamAngles:
    """Return the angles at seam points, each in its own plane O1, E, O2.

    Axes and normals that leave the plane are projected onto it, so that off the plane
    phi < phi_max is necessary for camera 2 to reach E and no longer sufficient.

    Args:
        points: E in [m], shape (n, 3).
        onward: Direction along the surface from camera 1's stretch into camera 2's,
            any length, shape (3,) or (n, 3); where it is square to the plane's trace
            on the surface (within 6 degrees), the side of O2 takes its place.
        centres: O1 and O2 in [m], shape (3,) or (n, 3).
        axes: Unit optical axes of both, shape (3,) or (n, 3).
        normals: Unit normals at E on camera 1's and camera 2's side, (n, 3).
    """
    points = np.asarray(points, dtype=np.float64)
    onward = np.broadcast_to(onward, points.shape)
    to1, to2 = centres[0] - points, centres[1] - points
    plane = _plane(to1, to2, onward, normals[0])
    out, on = _plane_axes(plane, to1, to2, onward, normals[0])

    def bearing(direction: _Array) -> _Array:
        return np.arctan2(_dot(direction, on), _dot(direction, out))

    delta = bearing(_on_plane(normals[1], plane, out))
    iota1, iota2 = -bearing(to1), _wrapped(bearing(to2) - delta)
    # The sum, not the wrapped difference of bearings: round a sharp edge phi passes pi.
    phi = iota1 + delta + iota2
    back1 = bearing(_on_plane(-np.asarray(axes[0]), plane, to1))
    back2 = bearing(_on_plane(-np.asarray(axes[1]), plane, to2))
    beta1 = _wrapped(back1 + iota1)
    beta2 = _wrapped(bearing(to2) - back2)
    return SeamAngles(
        phi, beta1, beta2, iota1, iota2, phi - beta1 - beta2, delta, out, on
    )


def _plane(to1: _Array, to2: _Array, onward: _Array, normals: _Array) -> _Array:
    """Unit normals of the planes O1, E, O2; of N and onward where these are in line."""
    plane = np.cross(to1, to2)
    size = np.linalg.norm(to1, axis=1) * np.linalg.norm(to2, axis=1)
    for spare in (onward, *np.eye(3)):
        flat = ~(np.linalg.norm(plane, axis=1) > _TINY * size)
        if not np.any(flat):
            break
        along = np.broadcast_to(spare, plane.shape)
        plane = np.where(flat[:, None], np.cross(normals, along) * size[:, None], plane)
    return plane / np.linalg.norm(plane, axis=1, keepdims=True)


def _plane_axes(
    plane: _Array, to1: _Array, to2: _Array, onward: _Array, normals: _Array
) -> tuple[_Array, _Array]:
    spare = to1 / np.linalg.norm(to1, axis=1, keepdims=True)
    out = _on_plane(normals, plane, spare)
    on = np.cross(plane, out)
    seam = _dot(onward, on)
    undecided = ~(np.abs(seam) > _UNDECIDED * np.linalg.norm(onward, axis=1))
    side = np.where(undecided, _dot(to2 - to1, on), seam)
    return out, np.where(side[:, None] < 0.0, -on, on)


def _on_plane(vectors: _Array, plane: _Array, spare: _Array) -> _Array:
    """Unit vectors along the projections; `spare` takes the place of a null one."""
    vectors = np.broadcast_to(vectors, plane.shape)
    flat = vectors - _dot(vectors, plane)[:, None] * plane
    flat = np.where(np.linalg.norm(flat, axis=1, keepdims=True) > _TINY, flat, spare)
    return flat / np.linalg.norm(flat, axis=1, keepdims=True)


def _dot(a: _Array, b: _Array) -> _Array:
    return np.sum(a * b, axis=-1)


def _wrapped(angle: _Array) -> _Array:
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
