"""The surface along a projector's light: first hits on a polar grid about the rings.

Each column of the grid is an azimuth about the ring axis, each row a ring coordinate c:
the tangent R (diverging light) or the radius in [m] (parallel light).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.devices.planned import PlannedProjector
from planning.scene import lighting
from planning.scene.lights import light_of
from planning.scene.limits import projector_limits
from planning.scene.samples import Target
from planning.scene.scene import Scene

_AZIMUTHS = 360
_GRIDS = "heights", "lit", "target", "faces", "points"


@dataclass(frozen=True, eq=False)
class BeamProfile:
    """What a projector's light meets first, shape (n_c, n_a) each.

    Attributes:
        coordinates: Ring coordinates of the rows, rising, shape (n_c,).
        heights: In ring coordinates, z of the point that is hit in [m]; NaN for none.
        lit: Whether the projector lights that point: every limit of eq. (2) holds.
        target: Whether it lies in the target.
        faces: Face that is hit, -1 for none.
        points: In the world in [m], shape (n_c, n_a, 3); NaN for none.
    """

    coordinates: NDArray[np.float64]
    heights: NDArray[np.float64]
    lit: NDArray[np.bool_]
    target: NDArray[np.bool_]
    faces: NDArray[np.int64]
    points: NDArray[np.float64]

    @classmethod
    def joined(cls, profiles: Sequence["BeamProfile"]) -> "BeamProfile":
        """Return where the same light meets several surfaces, column after column.

        Each face is then one of the surface that its column is of.
        """
        every = [[getattr(one, name) for one in profiles] for name in _GRIDS]
        return cls(profiles[0].coordinates, *(np.concatenate(g, axis=1) for g in every))

    @property
    def on_object(self) -> NDArray[np.bool_]:
        """Whether the ray meets the object at all, shape (n_c, n_a)."""
        return np.isfinite(self.heights)


def cast_beam(
    scene: Scene,
    projector: PlannedProjector,
    coordinates: NDArray[np.float64],
    n_azimuths: int = _AZIMUTHS,
) -> BeamProfile:
    """Cast a projector's light against the surface.

    Only light that leaves the projector is cast: a ring may reach beyond the panel.

    Coordinates are rising and positive, shape (n_c,).
    """
    step = 2.0 * np.pi / n_azimuths
    azimuths = np.arange(0.5, n_azimuths, dtype=np.float64) * step
    frame = projector.world_from_ring
    spokes = np.column_stack([np.cos(azimuths), np.sin(azimuths)])
    flat = (coordinates[:, None, None] * spokes).reshape(-1, 2)
    origins, rays = light_of(projector.device).ring_rays(frame, flat)
    faces, distances = scene.visibility.caster.first_hits(origins, rays)
    hit = np.flatnonzero(faces >= 0)
    points = np.broadcast_to(origins, rays.shape)[hit]
    points = points + distances[hit][:, None] * rays[hit]
    inside = lighting.in_panel(projector, points)
    hit, points = hit[inside], points[inside]
    faces = faces[hit]
    # What the ray meets first, no part of the surface hides.
    stage = lighting.first_failure(
        projector,
        on_faces(scene, points, faces),
        scene.requirements.projector,
        None,
        bodies=scene.bodies,
    )
    shape = len(coordinates), n_azimuths
    return BeamProfile(
        coordinates,
        _spread((points - frame[:3, 3]) @ frame[:3, 2], hit, np.nan, shape),
        _spread(stage == projector_limits.LIT, hit, False, shape),
        _spread(scene.target_faces[faces], hit, False, shape),
        _spread(faces, hit, -1, shape),
        _spread(points, hit, np.nan, shape),
    )


def on_faces(
    scene: Scene, points: NDArray[np.float64], faces: NDArray[np.int64]
) -> Target:
    """Return points (n, 3) on faces (n,) of the surface as samples."""
    normals = scene.mesh.face_normals[faces]
    return Target(SurfaceSamples(points, normals, faces, 0.0), scene.steep[faces])


def _spread(
    values: NDArray[Any],
    places: NDArray[np.int64],
    empty: float,
    shape: tuple[int, int],
) -> NDArray[Any]:
    """Return values at their places in the grid, `empty` elsewhere."""
    grid = np.full((shape[0] * shape[1], *values.shape[1:]), empty, dtype=values.dtype)
    grid[places] = values
    return grid.reshape(*shape, *values.shape[1:])
