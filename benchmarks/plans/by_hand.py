"""What a user would write instead: trimesh's rays, a greedy cover, scipy's MILP.

Candidates stand on a sphere at the rig's standoff. A projector lights what it sees
within the incidence limit and off the steep direction, eq. (2); a camera measures what
is lit, what it sees within its own limit, and from a projector that lights it by an
angle. Nothing is known of images, rings or errors.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from geometry.poses import fibonacci_cap
from planning.report.partial_plan import Prepared

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]

# Least angle between the light and the view of a point.
_ANGLE = np.radians(10.0)
_OFF_SURFACE = 1e-3
_POINTS = 2000


@dataclass(frozen=True, eq=False)
class ByHand:
    """A user's matrices of a prepared object, (n_points, n_candidates) each.

    Attributes:
        places: Candidates in [m], (n, 3).
        lights: What each lights.
        sees: What each sees as a camera.
        towards: Unit directions from points to candidates, (n_points, n, 3).
        seconds: Wall time that they took.
    """

    places: _Array
    lights: _Mask
    sees: _Mask
    towards: _Array
    seconds: float

    @classmethod
    def of(cls, ready: Prepared, n: int) -> "ByHand":
        """Cast the rays."""
        begin = time.monotonic()
        scene, limits = ready.scene, ready.scene.requirements
        mesh = trimesh.Trimesh(scene.mesh.vertices, scene.mesh.faces, process=False)
        wanted = np.where(scene.region >= 0, mesh.area_faces, 0.0)
        points, faces = trimesh.sample.sample_surface(
            mesh, _POINTS, face_weight=wanted, seed=0
        )[:2]
        normals, steep = mesh.face_normals[faces], scene.steep[faces]
        space = limits.workspace
        radius = float(np.mean(space.projector_radius_m))
        places = np.array(space.centre) + radius * fibonacci_cap(
            n, np.array([0.0, 0.0, 1.0]), np.pi
        )
        towards = places[None] - points[:, None]
        distance = np.linalg.norm(towards, axis=2)
        towards /= distance[:, :, None]
        facing = np.einsum("pcj,pj->pc", towards, normals)
        near = facing > 0.0
        row, column = np.nonzero(near)
        off = points + _OFF_SURFACE * normals * float(mesh.scale)
        hit = mesh.ray.intersects_any(off[row], towards[row, column])
        near[row[hit], column[hit]] = False
        along = np.abs(np.einsum("pcj,pj->pc", towards, steep))
        light = near & (facing >= np.cos(limits.projector.max_incidence))
        light &= along <= np.cos(limits.projector.min_tangent_angle)
        sees = near & (facing >= np.cos(limits.camera.max_incidence))
        return cls(places, light, sees, towards, time.monotonic() - begin)

    def measures(self, projectors: list[int]) -> _Mask:
        """What each candidate measures with chosen projectors."""
        measured = np.zeros_like(self.sees)
        for p in projectors:
            cosine = np.einsum("pcj,pj->pc", self.towards, self.towards[:, p])
            apart = cosine <= np.cos(_ANGLE)
            measured |= self.sees & apart & self.lights[:, p, None]
        return measured


def greedy(covers: _Mask, share: float) -> Iterator[tuple[int, bool]]:
    """Yield the candidate that adds most, again and again; whether it is enough."""
    reached = covers.any(axis=1)
    missing, need = reached.copy(), share * reached.sum()
    while missing.any():
        best = int(covers[missing].sum(axis=0).argmax())
        missing &= ~covers[:, best]
        yield best, reached.sum() - missing.sum() >= need


def by_milp(covers: _Mask, share: float, limit_s: float) -> list[int] | None:
    """Return the fewest candidates by `scipy.optimize.milp`; None: none in time."""
    covers = covers[covers.any(axis=1)]
    n, m = covers.shape
    # y_i <= sum of x that cover i; at least a share of all y.
    matrix = sparse.hstack([sparse.csr_array(covers.astype(float)), -sparse.eye(n)])
    enough = np.append(np.zeros(m), np.ones(n))
    found = milp(
        np.append(np.ones(m), np.zeros(n)),
        integrality=np.append(np.ones(m), np.zeros(n)),
        bounds=Bounds(0.0, 1.0),
        constraints=[
            LinearConstraint(matrix, lb=0.0),
            LinearConstraint(enough[None], lb=np.ceil(share * n)),
        ],
        options={"time_limit": limit_s},
    )
    if found.x is None:
        return None
    return np.flatnonzero(found.x[:m] > 0.5).tolist()
