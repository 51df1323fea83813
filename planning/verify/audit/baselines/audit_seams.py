"""Where two cameras meet: the plane O1, E, O2, and how far camera 2 reaches in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import root_scalar

from geometry.arrays import Array, Mask
from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.planned import PlannedCamera
from planning.model.document.device_records import BaselineRow
from planning.verify.audit.predicates.audit_optics import dot, in_image

_STEPS = 2000
# How near E a face must lie to lend its normal, as a share of the object's radius.
_BESIDE = 0.15
# Room for directions written with a few digits.
_WRITTEN = 1e-3


@dataclass(frozen=True, eq=False)
class SeamPlane:
    """The plane through O1, E and O2; angles count from camera 1's side to camera 2's.

    With u_i from E to O_i, and axes and normals projected into the plane::

        phi = (u1, -a1) + (-a1, -a2) + (-a2, u2) = beta_1 + delta_ax + beta_2
            = (u1, n1)  + (n1, n2)   + (n2, u2)  = iota_1 + delta_E + iota_2

    so that phi_max - phi = min(b_2 - beta_2, theta_2 - iota_2). Source: eqs. (9), (10).

    The turns are added one by one: round a sharp edge their sum passes pi, and where
    the lines of sight cross it is negative.

    Attributes:
        cameras: The first is held where it stands, the second could stand farther away.
        meeting: E, shape (3,) [m].
        normals: Normals at E on camera 1's and on camera 2's side, shape (2, 3).
        onward: Along the surface from camera 1's stretch into camera 2's, shape (3,).
    """

    cameras: tuple[PlannedCamera, PlannedCamera]
    meeting: Array
    normals: Array
    onward: Array

    @cached_property
    def arms(self) -> Array:
        """From E to O1 and to O2 in [m], shape (2, 3)."""
        poses = [camera.world_from_device for camera in self.cameras]
        return np.array([pose[:3, 3] - self.meeting for pose in poses])

    @cached_property
    def axes(self) -> Array:
        """Optical axes, shape (2, 3)."""
        return np.array([c.world_from_device[:3, 2] for c in self.cameras])

    @cached_property
    def pole(self) -> Array:
        """Unit normal of the plane; turning about it leads N1 towards onward, (3,)."""
        pole = np.cross(*self.arms)
        pole = pole / np.linalg.norm(pole)
        return pole if np.cross(self.normals[0], self.onward) @ pole >= 0.0 else -pole

    @property
    def phi(self) -> float:
        """Signed angle O1 E O2 in [rad]: iota_1 + delta_E + iota_2."""
        return sum(self.iota) + self.delta_surface

    @property
    def iota(self) -> tuple[float, float]:
        """Incidence at E on each camera's own side of the seam [rad]."""
        return self._turns(self.normals)

    @property
    def beta(self) -> tuple[float, float]:
        """Off-axis angle of E in each camera [rad]."""
        return self._turns(-self.axes)

    @property
    def delta_surface(self) -> float:
        """Turn of the surface at E, convex positive [rad]."""
        return self._turn(*self.normals)

    @cached_property
    def half_field(self) -> tuple[float, float]:
        """b_1 and b_2: where each camera's image ends on the side of E [rad]."""
        beta1, beta2 = self.beta
        one = _room(self.cameras[0], self.arms[0], -self.pole)
        return beta1 + one, beta2 + self.field_slack

    @property
    def standoffs(self) -> Array:
        """Depth of E along the optical axis of each camera [m], shape (2,)."""
        return -dot(self.arms, self.axes)

    def lengths(self) -> dict[str, float]:
        """Return D1, D2, d, d_lateral and d_axial in [m].

        With w = O2 - O1 and a the axis of camera 1: d = |w|, axial |w.a|, lateral
        |w - (w.a) a|.
        """
        baseline, axis = self.arms[1] - self.arms[0], self.axes[0]
        vectors = {"D1": self.arms[0], "D2": self.arms[1], "d": baseline}
        vectors["d_lateral"] = np.cross(baseline, axis)
        lengths = {name: float(np.linalg.norm(v)) for name, v in vectors.items()}
        return lengths | {"d_axial": float(abs(baseline @ axis))}

    def baseline_at(self, phi: float) -> float:
        """Return |O1 O2| if the angle at E were phi: the law of cosines [m]."""
        d1, d2 = np.linalg.norm(self.arms, axis=1)
        return float(np.sqrt(d1 * d1 + d2 * d2 - 2.0 * d1 * d2 * np.cos(phi)))

    def incidence_slack(self, largest: float) -> float:
        """Return theta_2 - iota_2 in [rad]."""
        return largest - self.iota[1]

    def _turns(self, about: Array) -> tuple[float, float]:
        """From arm 1 to the first direction, and from the second to arm 2 [rad]."""
        return self._turn(self.arms[0], about[0]), self._turn(about[1], self.arms[1])

    def _turn(self, start: Array, end: Array) -> float:
        """Signed angle between projections of two directions, in (-pi, pi]."""
        flat, other = (v - (v @ self.pole) * self.pole for v in (start, end))
        return float(np.arctan2(np.cross(flat, other) @ self.pole, flat @ other))

    @cached_property
    def field_slack(self) -> float:
        """b_2 - beta_2: how far E may turn until camera 2's image ends [rad].

        Negative where E itself lies outside the image.
        """
        return _room(self.cameras[1], self.arms[1], self.pole)


def section_of(row: BaselineRow, cameras: Mapping[str, PlannedCamera]) -> SeamPlane:
    """Return the plane that a row of `baselines` speaks of."""
    one, two = row.cameras
    pair, meeting = (cameras[one], cameras[two]), np.array(row.E)
    return SeamPlane(pair, meeting, np.array(row.normals), np.array(row.onward))


def _room(camera: PlannedCamera, to_centre: Array, pole: Array) -> float:
    """How far E's ray may turn about a pole until the image of a camera ends [rad].

    Negative where E lies outside the image: how far it must turn back.
    """
    turns = np.linspace(0.0, np.pi, _STEPS + 1)
    toward = -to_centre / np.linalg.norm(to_centre)
    frame = np.stack([toward, np.cross(pole, toward)])
    start = bool(_inside(camera, frame, turns[:1])[0])
    sense = 1.0 if start else -1.0
    changed = _inside(camera, frame, sense * turns) != start
    if not np.any(changed):
        return sense * np.pi

    def side(turn: float) -> float:
        inside = bool(_inside(camera, frame, np.array([sense * turn]))[0])
        return 1.0 if inside is start else -1.0

    first = int(np.argmax(changed))
    bracket = turns[first - 1], turns[first]
    return sense * float(root_scalar(side, bracket=bracket, method="bisect").root)


def _inside(camera: PlannedCamera, frame: Array, turns: Array) -> Mask:
    """Whether a camera has rays in its image, turned in a frame: E's ray and aside."""
    rays = np.cos(turns)[:, None] * frame[0] + np.sin(turns)[:, None] * frame[1]
    return in_image(camera.device, rays @ camera.world_from_device[:3, :3])


def faces_reach(mesh: TriangleMesh) -> Array:
    """Return how far the farthest corner of each face is from its centroid, (n_f,)."""
    arms = mesh.corners - mesh.face_centroids[:, None]
    return np.linalg.norm(arms, axis=2).max(axis=1)


def are_normals(
    normals: Array, meeting: Array, mesh: TriangleMesh, reach: Array
) -> bool:
    """Return whether both normals (2, 3) are those of faces beside E.

    `reach` is that of the faces.
    """
    most = reach + _BESIDE * mesh.radius
    # Most faces are out of reach along one axis alone.
    near = np.flatnonzero(np.abs(mesh.face_centroids[:, 0] - meeting[0]) <= most)
    apart = np.linalg.norm(mesh.face_centroids[near] - meeting, axis=1)
    beside = mesh.face_normals[near[apart <= most[near]]]
    return all(
        np.any(np.abs(beside - normal).max(axis=1) <= _WRITTEN) for normal in normals
    )


def is_onward(section: SeamPlane) -> bool:
    """Return whether a section's `onward` runs along the surface.

    It must be a unit vector in the plane O1, E, O2, square to the projection of N1.
    """
    onward, first = section.onward, section.normals[0]
    out = first - (first @ section.pole) * section.pole
    size = max(float(np.linalg.norm(out)), 1e-9)
    square = max(abs(onward @ section.pole), abs(onward @ out) / size)
    return bool(abs(np.linalg.norm(onward) - 1.0) <= _WRITTEN >= square)
