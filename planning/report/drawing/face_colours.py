"""Colours of faces: by what a plan measures of them, or by dominant region."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from geometry.parallel import n_threads
from planning.cameras.photogrammetry.measured_views import measured_views
from planning.model.plan import RigPlan
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.placed_bodies import Obstruction
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .picture_view import CLAY, Colour

# Values of `face_status`.
OUTSIDE_TARGET, MEASURED, NOT_MEASURED, NOT_LIT = 0, 1, 2, 3

# Told apart by lightness as well as by hue, so that colour blindness loses nothing.
_STATUS: tuple[tuple[str, Colour], ...] = (
    ("outside the target", CLAY),
    ("measured", (120, 190, 235)),
    ("target, lit but not measured", (240, 40, 140)),
    ("target, not lit", (120, 0, 80)),
)
_REGIONS: tuple[Colour, ...] = (
    (230, 190, 100),
    (120, 190, 235),
    (110, 190, 160),
    (205, 150, 190),
    (235, 150, 110),
    (150, 160, 220),
    (190, 200, 110),
    (225, 175, 175),
)


def face_status(plan: RigPlan, *, threads: int | None = None) -> NDArray[np.int8]:
    """Return what a plan does for each face at its centroid, for pictures; (n_f,).

    A face is measured if its centroid is; faces outside the target that aren't
    measured count as such.
    """
    threads = threads or n_threads()
    surface, required = plan.surface, plan.requirements
    mesh = surface.mesh
    scene = Scene(
        mesh,
        surface.region,
        surface.steep,
        required,
        0,
        threads,
        obstructions=Obstruction.about(mesh, surface.obstacles, threads),
    )
    scene = scene.among((*plan.projectors, *plan.cameras))
    faces = np.arange(len(mesh.faces))
    centroids = SurfaceSamples(mesh.face_centroids, mesh.face_normals, faces, 1.0)
    if plan.cameras_alone:
        target = Target(centroids, surface.steep)
        measured = measured_views(scene, plan.cameras, target).measured
        inside = surface.target_faces(required.target)
        status = np.where(inside, NOT_MEASURED, OUTSIDE_TARGET).astype(np.int8)
        status[measured] = MEASURED
        return status
    lit = lit_samples(scene, plan.projectors, Target(centroids, surface.steep))
    measured = measured_by(scene, plan.cameras, lit).any(axis=1)
    inside = surface.target_faces(required.target)
    status = np.where(inside, NOT_LIT, OUTSIDE_TARGET).astype(np.int8)
    bright = lit.target.samples.faces
    status[bright[inside[bright]]] = NOT_MEASURED
    status[bright[measured]] = MEASURED
    return status


def region_colours(region: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return a colour for each face by its region, clay for -1; (n_f,) to (n_f, 3)."""
    palette = np.array([*_REGIONS, CLAY], dtype=np.float64)
    return palette[np.where(region >= 0, region % len(_REGIONS), len(_REGIONS))]


def status_colours(
    face_status: NDArray[np.int8], n_faces: int
) -> tuple[NDArray[np.float64], Sequence[tuple[str, Colour]]]:
    """Return a colour for each face by its status, (n_f, 3), and their legend.

    Raises:
        ValueError: If the status doesn't fit the faces.
    """
    status = np.asarray(face_status)
    if status.shape != (n_faces,):
        raise ValueError(f"face_status must be ({n_faces},), got {status.shape}")
    if not np.all((status >= 0) & (status < len(_STATUS))):
        raise ValueError(f"face_status must hold 0 to 3, got {np.unique(status)}")
    order = (MEASURED, NOT_MEASURED, NOT_LIT, OUTSIDE_TARGET)
    legend = [_STATUS[k] for k in order if np.any(status == k)]
    return np.array([colour for _, colour in _STATUS], dtype=np.float64)[status], legend
