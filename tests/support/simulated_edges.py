"""Ring edges without images: points of an object, imaged and labelled exactly."""

import numpy as np

from geometry.mesh.sampling import sample_surface
from planning.verify.reconstruction.faults.supposed import Evidence, Supposed

_SAMPLES = 4000
# Cosine of the incidence at a camera from which on edges are decoded.
_SEEN = 0.2


def simulated_edges(
    supposed: Supposed,
    stands: Supposed | None = None,
    *,
    noise_px: float,
    outliers: float = 0.0,
    most: int = 150,
    seed: int = 0,
) -> Evidence:
    """Return what a rig as it stands gives to who believes what is supposed.

    Devices stand in the order of the plan. Points of the mesh, as large and where it
    stands, are imaged by each camera and labelled with the ring coordinate that each
    projector draws there, shadows of its light left aside; `outliers` is the share of
    labels that are wrong by up to a fifth.
    """
    rng = np.random.default_rng(seed)
    stands = stands or supposed
    (body,) = stands.objects
    samples = sample_surface(body.mesh, _SAMPLES, seed=seed)
    turn = body.world_from_device[:3, :3]
    points = body.centre + body.scale * (samples.points - body.mesh.centre) @ turn.T
    normals = samples.normals @ turn.T
    parts = []
    for p, projector in enumerate(stands.projectors):
        pixels, _ = projector.panel(points)
        lit = projector.in_panel(pixels)
        lit &= projector.incidence_cosine(points, normals) > 0.0
        rho = np.hypot(*supposed.plan.projectors[p].ring_plane(pixels).T)
        for c, camera in enumerate(stands.cameras):
            rays = points - camera.centre
            reach = np.linalg.norm(rays, axis=1)
            rays /= reach[:, None]
            seen = lit & (np.einsum("ij,ij->i", rays, normals) < -_SEEN)
            first, _ = body.met(camera.centre, rays)
            seen &= np.linalg.norm(first - points, axis=1) < 1e-4 * reach
            rows = rng.permutation(np.flatnonzero(seen))[:most]
            radii = rho[rows]
            wrong = rng.random(len(rows)) < outliers
            radii[wrong] *= rng.uniform(0.8, 1.2, wrong.sum())
            where = camera.project(points[rows])
            where += noise_px * rng.normal(size=where.shape)
            noise = np.full(len(rows), noise_px)
            part = Evidence.at(where, p, c)
            parts.append(Evidence(where, radii, part.camera, part.projector, noise))
    return Evidence.join(parts)
