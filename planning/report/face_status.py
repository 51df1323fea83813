"""What a plan does for each face, judged at its centroid: for pictures only."""

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.plan import RigPlan
from planning.report.drawing.face_colours import (
    MEASURED,
    NOT_LIT,
    NOT_MEASURED,
    OUTSIDE_TARGET,
)
from planning.scene.lighting import lit_stages
from planning.scene.limits import projector_limits
from planning.scene.measured import lit_samples, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene


def face_status(plan: RigPlan, *, threads: int = 2) -> NDArray[np.int8]:
    """Return a status of `face_colours` for each face, shape (n_f,).

    A face is measured if its centroid is; faces outside the target that aren't
    measured count as such.

    Args:
        plan: The plan.
        threads: Worker threads.
    """
    mesh, required = plan.surface.mesh, plan.requirements
    scene = Scene(mesh, plan.surface.region, plan.surface.steep, required, 0, threads)
    scene = scene.among((*plan.projectors, *plan.cameras))
    faces = np.arange(len(mesh.faces))
    centroids = SurfaceSamples(mesh.face_centroids, mesh.face_normals, faces, 1.0)
    target = Target(centroids, plan.surface.steep)
    stages = lit_stages(scene, plan.projectors, target)
    lit = (stages == projector_limits.LIT).any(axis=1)
    measured = np.zeros(len(faces), dtype=bool)
    if lit.any():
        rows = lit_samples(scene, plan.projectors, target)
        seen = measured_by(scene, plan.cameras, rows).any(axis=1)
        measured[rows.target.samples.faces[seen]] = True
    inside = plan.surface.target_faces(required.target)
    status = np.full(len(faces), OUTSIDE_TARGET, dtype=np.int8)
    status[inside & lit] = NOT_MEASURED
    status[inside & ~lit] = NOT_LIT
    status[measured] = MEASURED
    return status
