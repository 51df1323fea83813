"""Where two cameras meet: the plane O1, E, O2, and how far camera 2 reaches in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from planning.model.document.device_records import BaselineRow
from planning.model.planned import PlannedCamera
from planning.verify.audit.predicates.audit_optics import in_image, pixels_of

_STEPS = 2000
_HALVINGS = 40
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
        camera1: First camera, held where it stands.
        camera2: Second camera, which could stand farther away.
        meeting: E, shape (3,) [m].
        normals: Normals at E on camera 1's and on camera 2's side, shape (2, 3).
        onward: Along the surface from camera 1's stretch into camera 2's, shape (3,).
    """

    camera1: PlannedCamera
    camera2: PlannedCamera
    meeting: NDArray[np.float64]
    normals: NDArray[np.float64]
    onward: NDArray[np.float64]

    @property
    def to_first(self) -> NDArray[np.float64]:
        """From E to O1 in [m], shape (3,)."""
        return self.camera1.world_from_device[:3, 3] - self.meeting

    @property
    def to_second(self) -> NDArray[np.float64]:
        """From E to O2 in [m], shape (3,)."""
        return self.camera2.world_from_device[:3, 3] - self.meeting

    @cached_property
    def pole(self) -> NDArray[np.float64]:
        """Unit normal of the plane; turning about it leads N1 towards onward, (3,)."""
        pole = np.cross(self.to_first, self.to_second)
        pole = pole / np.linalg.norm(pole)
        return pole if np.cross(self.normals[0], self.onward) @ pole >= 0.0 else -pole

    @property
    def phi(self) -> float:
        """Signed angle O1 E O2 in [rad]: iota_1 + delta_E + iota_2."""
        iota1, iota2 = self.iota
        return iota1 + self.delta_surface + iota2

    @property
    def iota(self) -> tuple[float, float]:
        """Incidence at E on each camera's own side of the seam [rad]."""
        first, second = self.normals
        return self._turn(self.to_first, first), self._turn(second, self.to_second)

    @property
    def beta(self) -> tuple[float, float]:
        """Off-axis angle of E in each camera [rad]."""
        one, two = (c.world_from_device[:3, 2] for c in (self.camera1, self.camera2))
        return self._turn(self.to_first, -one), self._turn(-two, self.to_second)

    @property
    def delta_surface(self) -> float:
        """Turn of the surface at E, convex positive [rad]."""
        return self._turn(self.normals[0], self.normals[1])

    @cached_property
    def half_field(self) -> tuple[float, float]:
        """b_1 and b_2: where each camera's image ends on the side of E [rad]."""
        beta1, beta2 = self.beta
        one = _room(self.camera1, self.to_first, -self.pole)
        return beta1 + one, beta2 + self.field_slack

    @property
    def standoffs(self) -> tuple[float, float]:
        """Depth of E along the optical axis of each camera [m]."""
        one, two = (c.world_from_device[:3, 2] for c in (self.camera1, self.camera2))
        return float(-self.to_first @ one), float(-self.to_second @ two)

    def lengths(self) -> dict[str, float]:
        """Return D1, D2, d, d_lateral and d_axial in [m].

        With w = O2 - O1 and a the axis of camera 1: d = |w|, axial |w.a|, lateral
        |w - (w.a) a|.
        """
        baseline = self.to_second - self.to_first
        axis = self.camera1.world_from_device[:3, 2]
        return {
            "D1": float(np.linalg.norm(self.to_first)),
            "D2": float(np.linalg.norm(self.to_second)),
            "d": float(np.linalg.norm(baseline)),
            "d_lateral": float(np.linalg.norm(np.cross(baseline, axis))),
            "d_axial": float(abs(baseline @ axis)),
        }

    def baseline_at(self, phi: float) -> float:
        """Return |O1 O2| if the angle at E were phi: the law of cosines [m]."""
        d1, d2 = np.linalg.norm(self.to_first), np.linalg.norm(self.to_second)
        return float(np.sqrt(d1 * d1 + d2 * d2 - 2.0 * d1 * d2 * np.cos(phi)))

    def incidence_slack(self, largest: float) -> float:
        """Return theta_2 - iota_2 in [rad]."""
        return largest - self._turn(self.normals[1], self.to_second)

    def _turn(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> float:
        """Signed angle between projections of two directions, in (-pi, pi]."""
        flat, other = (v - (v @ self.pole) * self.pole for v in (start, end))
        return float(np.arctan2(np.cross(flat, other) @ self.pole, flat @ other))

    @cached_property
    def field_slack(self) -> float:
        """b_2 - beta_2: how far E may turn until camera 2's image ends [rad].

        Negative where E itself lies outside the image.
        """
        return _room(self.camera2, self.to_second, self.pole)


def section_of(row: BaselineRow, cameras: Mapping[str, PlannedCamera]) -> SeamPlane:
    """Return the plane that a row of `baselines` speaks of."""
    one, two = row.cameras
    return SeamPlane(
        cameras[one],
        cameras[two],
        np.array(row.E),
        np.array(row.normals),
        np.array(row.onward),
    )


def _room(
    camera: PlannedCamera, to_centre: NDArray[np.float64], pole: NDArray[np.float64]
) -> float:
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
    high = float(turns[int(np.argmax(changed))])
    low = float(turns[int(np.argmax(changed)) - 1])
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        at = np.array([sense * middle])
        if bool(_inside(camera, frame, at)[0]) == start:
            low = middle
        else:
            high = middle
    return sense * low


def _inside(
    camera: PlannedCamera,
    frame: NDArray[np.float64],
    turns: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether a camera has rays in its image, turned in a frame: E's ray and aside."""
    rays = np.cos(turns)[:, None] * frame[0] + np.sin(turns)[:, None] * frame[1]
    local = rays @ camera.world_from_device[:3, :3]
    ahead = local[:, 2] > 1e-9
    inside = np.zeros(len(turns), dtype=bool)
    device = camera.device
    inside[ahead] = in_image(device.resolution, pixels_of(device, local[ahead]))
    return inside


def are_normals(
    normals: NDArray[np.float64], meeting: NDArray[np.float64], mesh: TriangleMesh
) -> bool:
    """Return whether both normals (2, 3) are those of faces beside E."""
    apart = np.linalg.norm(mesh.face_centroids - meeting, axis=1)
    beside = mesh.face_normals[apart <= _reach(mesh) + _BESIDE * mesh.radius]
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


def distance_to_surface(mesh: TriangleMesh, point: NDArray[np.float64]) -> float:
    """Return the distance of a point from the faces in [m], infinite if over 1 mm."""
    near = np.linalg.norm(mesh.face_centroids - point, axis=1) <= _reach(mesh) + 1e-3
    corners = mesh.corners[near]
    if len(corners) == 0:
        return np.inf
    along = np.roll(corners, -1, axis=1) - corners
    square = np.maximum((along * along).sum(axis=2), np.finfo(float).tiny)
    share = np.clip(((point - corners) * along).sum(axis=2) / square, 0.0, 1.0)
    edges = np.linalg.norm(corners + share[..., None] * along - point, axis=2).min(
        axis=1
    )
    normals = mesh.face_normals[near]
    inward = np.cross(normals[:, None], along)
    above = np.all(((point - corners) * inward).sum(axis=2) >= 0.0, axis=1)
    height = np.abs(((point - corners[:, 0]) * normals).sum(axis=1))
    best = np.where(above & np.any(normals != 0.0, axis=1), height, edges)
    return float(best.min())


def _reach(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Largest distance of each face's corners from its centroid [m]."""
    arms = mesh.corners - mesh.face_centroids[:, None]
    return np.linalg.norm(arms, axis=2).max(axis=1)
