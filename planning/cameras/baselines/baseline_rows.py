"""The `baselines` rows of a plan: eqs. (9)-(10) at the tightest seam point of a pair.

Every seam sample is tested in its own plane O1, E, O2; the row shows the one with the
least slack. Off the plane of the two axes the inequality is necessary, not sufficient:
coverage itself is decided by rays, and these rows say how far the cameras are from the
baseline at which they would part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.devices.planned import PlannedCamera, meet
from planning.model.document.device_records import BaselineRow

from .coverage_triangle import SeamAngles, baseline_parts, largest_baseline, seam_angles
from .seams import SampledSurface, Seam, both_orders, find_seams, neighbouring_pairs

_Array = NDArray[np.float64]

# Normals that turn less from one sample to the next are one smooth surface.
_CREASE_COSINE = np.cos(np.radians(30.0))
_SCAN = 128
# Optical centres that are nearer have no plane with E [m].
_ONE_PLACE = 1e-6
_BISECTIONS = 45


@dataclass(frozen=True, eq=False)
class SeamTest:
    """Eqs. (9)-(10) at every sample of a seam, each array (m,) or (m, 3).

    Attributes:
        seam: Where it was tested.
        points: E in [m].
        normals: Unit normals at E on camera 1's and camera 2's side: the same, or
            apart beyond a crease.
        angles: The signed angles.
        half_field1: b_1, half field of camera 1 beyond E in the plane [rad].
        half_field2: b_2 of camera 2.
        phi_max: Largest phi at which camera 2 still reaches E [rad].
    """

    seam: Seam
    points: _Array
    normals: tuple[_Array, _Array]
    angles: SeamAngles
    half_field1: _Array
    half_field2: _Array
    phi_max: _Array

    @property
    def slack(self) -> _Array:
        """phi_max - phi in [rad]."""
        return self.phi_max - self.angles.phi


def baseline_rows(
    cameras: Sequence[PlannedCamera],
    surface: SampledSurface,
    measured_by: NDArray[np.bool_],
    camera_max_incidence: float,
) -> list[BaselineRow]:
    """Return one row for each order of each neighbouring pair of cameras.

    Two at one place, which may be of different models, have no baseline, and no row.
    `docs/method/baselines.md` defines every key.
    """
    rows: list[BaselineRow] = []
    pairs = [
        (i, j)
        for i, j in neighbouring_pairs(measured_by, surface)
        if meet(cameras[i].station, cameras[j].station)
        and _are_apart(cameras[i], cameras[j])
    ]
    for seam in find_seams(both_orders(pairs), surface, measured_by):
        pair = [cameras[index] for index in seam.cameras]
        test = check_seam(pair, surface, seam, camera_max_incidence)
        rows.append(_row(pair, test, camera_max_incidence))
    return rows


def _are_apart(one: PlannedCamera, two: PlannedCamera) -> bool:
    apart = one.world_from_device[:3, 3] - two.world_from_device[:3, 3]
    return bool(np.linalg.norm(apart) > _ONE_PLACE)


def check_seam(
    pair: Sequence[PlannedCamera],
    surface: SampledSurface,
    seam: Seam,
    camera_max_incidence: float,
) -> SeamTest:
    """Return eqs. (9)-(10) at every sample of the seam of a pair of cameras."""
    one, two = pair
    points = surface.points[seam.points]
    here, beyond = surface.normals[seam.points], surface.normals[seam.beyond]
    smooth = np.einsum("ij,ij->i", here, beyond) > _CREASE_COSINE
    beyond = np.where(smooth[:, None], here, beyond)
    angles, half1, half2 = angles_and_fields(
        one, two, points, seam.onward, (here, beyond)
    )
    phi_max = angles.largest(half2, camera_max_incidence)
    return SeamTest(seam, points, (here, beyond), angles, half1, half2, phi_max)


def angles_and_fields(
    one: PlannedCamera,
    two: PlannedCamera,
    points: _Array,
    onward: _Array,
    normals: tuple[_Array, _Array],
) -> tuple[SeamAngles, _Array, _Array]:
    """Return the signed angles at seam points, and b_1 and b_2 there [rad].

    E and the unit normals on camera 1's and camera 2's side are (n, 3); `onward` leads
    from camera 1's stretch into camera 2's, (3,) or (n, 3).
    """
    angles = seam_angles(
        points,
        onward,
        centres=(one.world_from_device[:3, 3], two.world_from_device[:3, 3]),
        axes=(one.world_from_device[:3, 2], two.world_from_device[:3, 2]),
        normals=normals,
    )
    # Seen from camera 1, E leaves the axis towards camera 2's stretch, and vice versa.
    half1 = _field_beyond(one, angles, -angles.iota1, angles.beta1, -1.0)
    bearing2 = angles.iota2 + angles.delta_surface
    half2 = _field_beyond(two, angles, bearing2, angles.beta2, 1.0)
    return angles, half1, half2


def half_field(
    camera: PlannedCamera, along: _Array, towards: _Array, at: _Array
) -> _Array:
    """Return the half field of a camera in planes through its optical centre.

    The rays cos(beta) along + sin(beta) towards sweep a plane; the half field b is the
    largest beta up to which they stay in the image, from E's own beta on (or, where E
    is outside the image, the beta at which they first enter it). The principal point
    may be anywhere, so b may differ from side to side.

    Args:
        camera: Pose and optics.
        along: Unit projections of the optical axis onto the planes, shape (n, 3).
        towards: Unit directions in the planes, square to `along`, to the side of E's
            positive beta, shape (n, 3).
        at: beta of E in [rad], shape (n,).

    Returns:
        b in [rad], shape (n,).
    """
    device_from_world = camera.world_from_device[:3, :3]
    along, towards = along @ device_from_world, towards @ device_from_world
    straight = _undistorted_edge(camera.device, along, towards)
    if not any(camera.device.distortion):
        return straight
    return _distorted_edge(camera.device, along, towards, at, straight)


def _undistorted_edge(device: PinholeModel, along: _Array, towards: _Array) -> _Array:
    """Where a ray leaves the four planes of the image's frustum."""
    low, high = device.sides()
    inward = np.array(
        [[1, 0, -low[0]], [-1, 0, high[0]], [0, 1, -low[1]], [0, -1, high[1]]]
    )
    a, b = along @ inward.T, towards @ inward.T
    # a cos(beta) + b sin(beta) >= 0 bounds beta from above where b < 0.
    leave = np.where(b < 0.0, np.arctan2(a, np.abs(b)), 0.5 * np.pi)
    return leave.min(axis=1)


def _distorted_edge(
    device: PinholeModel, along: _Array, towards: _Array, at: _Array, spare: _Array
) -> _Array:
    def inside(beta: _Array) -> NDArray[np.bool_]:
        ray = np.cos(beta)[..., None] * along + np.sin(beta)[..., None] * towards
        return device.contains(device.project(ray))

    start = inside(at)
    end = np.where(start, 0.5 * np.pi, -0.5 * np.pi)
    scan = at + (end - at) * np.arange(_SCAN + 1)[:, None] / _SCAN
    changed = np.stack([inside(beta) != start for beta in scan])
    first = np.maximum(changed.argmax(axis=0), 1)
    each = np.arange(len(at))
    last, other = scan[first - 1, each], scan[first, each]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (last + other)
        same = inside(middle) == start
        last, other = np.where(same, middle, last), np.where(same, other, middle)
    return np.where(changed.any(axis=0), 0.5 * (last + other), spare)


def _field_beyond(
    camera: PlannedCamera,
    angles: SeamAngles,
    bearing: _Array,
    beta: _Array,
    sense: float,
) -> _Array:
    """Half field of a camera seen from E at a bearing; its axis is beta from there."""
    axis = bearing - sense * beta
    cosine, sine = np.cos(axis)[:, None], np.sin(axis)[:, None]
    along = -(cosine * angles.outward + sine * angles.onward)
    towards = -sense * (cosine * angles.onward - sine * angles.outward)
    return half_field(camera, along, towards, beta)


def _row(
    pair: Sequence[PlannedCamera], test: SeamTest, max_incidence: float
) -> BaselineRow:
    one, two = pair
    i = int(np.argmin(test.slack))
    point = test.points[i]
    angles = test.angles
    centre1, centre2 = one.world_from_device[:3, 3], two.world_from_device[:3, 3]
    axis1, axis2 = one.world_from_device[:3, 2], two.world_from_device[:3, 2]
    d1 = float(np.linalg.norm(point - centre1))
    d2 = float(np.linalg.norm(point - centre2))
    standoff1, standoff2 = (point - centre1) @ axis1, (point - centre2) @ axis2
    lateral, axial = baseline_parts(centre1, axis1, centre2)
    half1, half2 = test.half_field1[i], test.half_field2[i]
    phi, phi_max = float(angles.phi[i]), float(test.phi_max[i])
    d_max = float(largest_baseline(d1, d2, phi_max))
    by_field = half2 - angles.beta2[i] < max_incidence - angles.iota2[i]
    return BaselineRow(
        cameras=(one.id, two.id),
        E=point.tolist(),
        standoff1=float(standoff1),
        standoff2=float(standoff2),
        C1=float(standoff1 * np.tan(half1)),
        C2=float(standoff2 * np.tan(half2)),
        D1=d1,
        D2=d2,
        phi=phi,
        phi_max=phi_max,
        d=float(np.linalg.norm(centre2 - centre1)),
        d_lateral=float(lateral),
        d_axial=float(axial),
        d_max=d_max if np.isfinite(d_max) else None,
        slack=phi_max - phi,
        covered=phi < phi_max,
        limit="camera_field" if by_field else "camera_incidence",
        beta=(float(angles.beta1[i]), float(angles.beta2[i])),
        iota=(float(angles.iota1[i]), float(angles.iota2[i])),
        half_field=(float(half1), float(half2)),
        max_incidence=max_incidence,
        delta_axes=float(angles.delta_axes[i]),
        delta_surface=float(angles.delta_surface[i]),
        normals=(test.normals[0][i].tolist(), test.normals[1][i].tolist()),
        onward=angles.onward[i].tolist(),
        shares_border=test.seam.shares_border,
        n_seam=len(test.points),
    )
