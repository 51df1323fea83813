"""The surface along a projector's light: first hits on a polar grid about the rings.

Each column of the grid is an azimuth about the ring axis, each row a ring coordinate c:
the tangent R (diverging light) or the radius in [m] (parallel light).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.planned import PlannedProjector
from planning.scene import lighting
from planning.scene.lights import light_of
from planning.scene.limits import projector_limits
from planning.scene.samples import Target
from planning.scene.scene import Scene

# Rays that miss the object's ball by more than this share of its radius aren't cast.
_ROOM = 1.001


@dataclass(frozen=True, eq=False)
class BeamProfile:
    """What a projector's light meets first, shape (n_c, n_a) each.

    Attributes:
        coordinates: Ring coordinates of the rows, rising, shape (n_c,).
        azimuths: About the ring axis, from its x towards y in [rad], shape (n_a,).
        heights: In ring coordinates, z of the point that is hit in [m]; NaN for none.
        lit: Whether the projector lights that point: every limit of eq. (2) holds.
        target: Whether it lies in the target.
        faces: Face that is hit, -1 for none.
        points: In the world in [m], shape (n_c, n_a, 3); NaN for none.
    """

    coordinates: NDArray[np.float64]
    azimuths: NDArray[np.float64]
    heights: NDArray[np.float64]
    lit: NDArray[np.bool_]
    target: NDArray[np.bool_]
    faces: NDArray[np.int64]
    points: NDArray[np.float64]

    @property
    def on_object(self) -> NDArray[np.bool_]:
        """Whether the ray meets the object at all, shape (n_c, n_a)."""
        return np.isfinite(self.heights)


def cast_beam(
    scene: Scene,
    projector: PlannedProjector,
    coordinates: NDArray[np.float64],
    n_azimuths: int,
) -> BeamProfile:
    """Cast a projector's light against the surface.

    Only light that leaves the projector is cast: a ring may reach beyond the panel.

    Args:
        scene: Surface and limits.
        projector: Pose, optics and rings.
        coordinates: Ring coordinates of the rows, rising and positive, shape (n_c,).
        n_azimuths: Number of columns.
    """
    step = 2.0 * np.pi / n_azimuths
    azimuths = np.arange(0.5, n_azimuths, dtype=np.float64) * step
    shape = len(coordinates), n_azimuths
    origins, rays = beam_rays(projector, coordinates, azimuths)
    aimed = np.flatnonzero(_near(scene, origins, rays))
    start = origins if origins.ndim == 1 else origins[aimed]
    faces, distances = scene.visibility.caster.first_hits(start, rays[aimed])
    hit = faces >= 0
    found, faces = aimed[hit], faces[hit]
    begin = origins if origins.ndim == 1 else origins[found]
    points = begin + distances[hit][:, None] * rays[found]
    inside = lighting.in_panel(projector, points)
    found, faces, points = found[inside], faces[inside], points[inside]
    normals = scene.mesh.face_normals[faces]
    met = Target(SurfaceSamples(points, normals, faces, 0.0), scene.steep[faces])
    # What the ray meets first, no part of the surface hides.
    limits, bodies = scene.requirements.projector, scene.bodies
    stage = lighting.first_failure(projector, met, limits, None, bodies=bodies)
    ring = points - projector.world_from_ring[:3, 3]
    heights = ring @ projector.world_from_ring[:3, 2]
    return BeamProfile(
        coordinates,
        azimuths,
        _spread(heights, found, np.nan, shape),
        _spread(stage == projector_limits.LIT, found, False, shape),
        _spread(scene.target_faces[faces], found, False, shape),
        _spread(faces, found, -1, shape),
        _spread(points, found, np.nan, shape),
    )


def beam_rays(
    projector: PlannedProjector,
    coordinates: NDArray[np.float64],
    azimuths: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rays of a grid, row by row.

    Args:
        projector: Ring frame and kind of light.
        coordinates: Ring coordinates of the rows, shape (n_c,).
        azimuths: Of the columns in [rad], shape (n_a,).

    Returns:
        Origins in [m], (3,) in diverging light, else (n, 3); unit directions, (n, 3).
    """
    frame = projector.world_from_ring
    flat = np.column_stack(
        [
            np.outer(coordinates, np.cos(azimuths)).ravel(),
            np.outer(coordinates, np.sin(azimuths)).ravel(),
        ]
    )
    return light_of(projector.device).ring_rays(frame, flat)


def _near(
    scene: Scene, origins: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether rays pass through the ball about the bounding box."""
    low, high = scene.mesh.bounds
    offsets = 0.5 * (low + high) - origins
    along = np.einsum("ij,ij->i", np.broadcast_to(offsets, rays.shape), rays)
    square = np.sum(offsets * offsets, axis=-1) - along * along
    reach = 0.5 * _ROOM * float(np.linalg.norm(high - low))
    return (along > -reach) & (square <= reach * reach)


def _spread(
    values: NDArray[Any],
    found: NDArray[np.int64],
    empty: float,
    shape: tuple[int, int],
) -> NDArray[Any]:
    """Return values at their places in the grid, `empty` elsewhere."""
    grid = np.full((shape[0] * shape[1], *values.shape[1:]), empty, dtype=values.dtype)
    grid[found] = values
    return grid.reshape(*shape, *values.shape[1:])
