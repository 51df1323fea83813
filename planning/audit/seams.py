"""Where two cameras meet: the plane O1, E, O2, and how far camera 2 reaches in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import TriangleMesh
from planning.plan import PlannedCamera, RigPlan

from .optics import in_image, pixels_of

_STEPS = 2000
_HALVINGS = 40
# How near E a face must lie to lend its normal, as a share of the object's radius.
_BESIDE = 0.15


@dataclass(frozen=True, eq=False)
class Section:
    """The plane through O1, E and O2; angles count from camera 1's side to camera 2's.

    With u_i from E to O_i, and axes and normals projected into the plane::

        phi = (u1, -a1) + (-a1, -a2) + (-a2, u2) = beta_1 + delta_ax + beta_2
            = (u1, n1)  + (n1, n2)   + (n2, u2)  = iota_1 + delta_E + iota_2

    so that phi_max - phi = min(b_2 - beta_2, theta_2 - iota_2). Source: eqs. (9), (10).

    Attributes:
        camera1: First camera, held where it stands.
        camera2: Second camera, which could stand farther away.
        meeting: E, shape (3,) [m].
    """

    camera1: PlannedCamera
    camera2: PlannedCamera
    meeting: NDArray[np.float64]

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
        """Unit normal of the plane; turning about it leads from O1 to O2, (3,)."""
        pole = np.cross(self.to_first, self.to_second)
        return pole / np.linalg.norm(pole)

    @property
    def phi(self) -> float:
        """Angle O1 E O2 in [rad]."""
        across = np.linalg.norm(np.cross(self.to_first, self.to_second))
        return float(np.arctan2(across, self.to_first @ self.to_second))

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

    def turn_to_second(self, direction: NDArray[np.float64]) -> float:
        """Return the signed angle from a direction, projected, to u2 in [rad]."""
        flat = direction - (direction @ self.pole) * self.pole
        across = np.cross(flat, self.to_second) @ self.pole
        return float(np.arctan2(across, flat @ self.to_second))

    def field_slack(self) -> float:
        """Return b_2 - beta_2: how far E may turn until camera 2's image ends [rad].

        Negative where E itself lies outside the image.
        """
        turns = np.linspace(0.0, np.pi, _STEPS + 1)
        inside = self._inside(turns)
        if not inside[0]:
            back = self._inside(-turns)
            return -float(turns[np.argmax(back)]) if np.any(back) else -np.pi
        if np.all(inside):
            return float(np.pi)
        low = float(turns[int(np.argmin(inside)) - 1])
        high = float(turns[int(np.argmin(inside))])
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            if self._inside(np.array([middle]))[0]:
                low = middle
            else:
                high = middle
        return low

    def _inside(self, turns: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether camera 2 has rays in its image that are turned on from E."""
        toward = -self.to_second / np.linalg.norm(self.to_second)
        aside = np.cross(self.pole, toward)
        rays = np.cos(turns)[:, None] * toward + np.sin(turns)[:, None] * aside
        local = rays @ self.camera2.world_from_device[:3, :3]
        ahead = local[:, 2] > 1e-9
        inside = np.zeros(len(turns), dtype=bool)
        device = self.camera2.device
        inside[ahead] = in_image(device.resolution, pixels_of(device, local[ahead]))
        return inside


def limit_of_row(
    section: Section, row: Mapping[str, Any], plan: RigPlan
) -> float | None:
    """Return phi_max of a row of the table in [rad]; None if its normals are strange.

    The row says which normals meet at E (on camera 1's side, on camera 2's); both must
    be those of faces beside E. Without them the nearest face serves.
    """
    normal = _second_normal(section.meeting, row, plan.surface.mesh)
    if normal is None:
        return None
    incidence = plan.requirements.camera.max_incidence - section.turn_to_second(normal)
    return section.phi + min(section.field_slack(), incidence)


def _second_normal(
    meeting: NDArray[np.float64], row: Mapping[str, Any], mesh: TriangleMesh
) -> NDArray[np.float64] | None:
    apart = np.linalg.norm(mesh.face_centroids - meeting, axis=1)
    if row.get("normals") is None:
        return mesh.face_normals[np.argmin(apart)]
    try:
        normals = np.asarray(row["normals"], dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if normals.shape != (2, 3):
        return None
    reach = np.linalg.norm(mesh.corners - mesh.face_centroids[:, None], axis=2).max(
        axis=1
    )
    beside = mesh.face_normals[apart <= reach + _BESIDE * mesh.radius]
    for normal in normals:
        if not np.any(np.abs(beside - normal).max(axis=1) <= 1e-3):
            return None
    return normals[1]


def distance_to_surface(mesh: TriangleMesh, point: NDArray[np.float64]) -> float:
    """Return the distance of a point from the faces in [m], infinite if over 1 mm."""
    reach = np.linalg.norm(mesh.corners - mesh.face_centroids[:, None], axis=2).max(
        axis=1
    )
    near = np.linalg.norm(mesh.face_centroids - point, axis=1) <= reach + 1e-3
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
