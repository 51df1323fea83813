"""Labels of single images by a prior mesh, held to the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import Shot


@dataclass(frozen=True)
class LabelCount:
    """How labels by a prior mesh compare with the truth; numbers of line points.

    Attributes:
        n: Found in all images.
        right: Labelled with the ring and root that they are of.
        wrong: Labelled otherwise.
        stray: Labelled, though the surface there is on no ring.
        off_prior: Left out: no ring meets the ray near the prior.
        ambiguous: Left out: several do.
    """

    n: int
    right: int
    wrong: int
    stray: int = 0
    off_prior: int = 0
    ambiguous: int = 0

    def __add__(self, other: "LabelCount") -> "LabelCount":
        return LabelCount(
            self.n + other.n,
            self.right + other.right,
            self.wrong + other.wrong,
            self.stray + other.stray,
            self.off_prior + other.off_prior,
            self.ambiguous + other.ambiguous,
        )


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of an object before it is measured.

    Attributes:
        mesh: That it lies near.
        tolerance_m: How near [m].
    """

    mesh: TriangleMesh
    tolerance_m: float

    @classmethod
    def moved(cls, mesh: TriangleMesh, tolerance_m: float) -> "Prior":
        """Return a mesh that is moved back, along +y, by 5/6 of the tolerance."""
        move = np.array([0.0, tolerance_m / 1.2, 0.0])
        return cls(TriangleMesh(mesh.vertices + move, mesh.faces), tolerance_m)


def judged_labels(scanner: Scanner, shots: Sequence[Shot]) -> LabelCount:
    """Hold the labels of single images to the truth.

    Args:
        scanner: Devices and the object that was rendered.
        shots: What the images gave.
    """
    caster = RayCaster(scanner.mesh, threads=1)
    count = LabelCount(0, 0, 0)
    for shot in shots:
        rings, roots = shot.labels.rings, shot.labels.roots
        true = true_labels(shot.lines.pixels, shot.pair, caster, shot.width)
        labelled = rings >= 0
        right = labelled & (rings == true[0]) & (roots == true[1])
        count += LabelCount(
            len(rings),
            int(np.count_nonzero(right)),
            int(np.count_nonzero(labelled & ~right & (true[0] >= 0))),
            int(np.count_nonzero(labelled & (true[0] < 0))),
            shot.labels.rejected["off_prior"],
            shot.labels.rejected["ambiguous"],
        )
    return count


def true_labels(
    pixels: Array, pair: PairCalibration, caster: RayCaster, width: float
) -> tuple[Indices, NDArray[np.int8]]:
    """Return the ring and root that really are at pixels; ring -1: none is.

    Args:
        pixels: In the camera's image, shape (n, 2).
        pair: Calibration of both devices.
        caster: Over the object.
        width: Of a line; what lies farther than that from a ring isn't on it.
    """
    camera, projector = pair.camera, pair.projector
    rays = camera.rays(pixels)
    faces, away = caster.first_hits(camera.centre, rays)
    points = camera.centre + np.where(faces >= 0, away, 0.0)[:, None] * rays
    local, radii = projector.to_ring(points), projector.pattern.radii
    rho = projector.ring_coordinate(points)
    ring = np.argmin(np.abs(rho[:, None] - radii), axis=1)
    on_ring = (faces >= 0) & (np.abs(rho - radii[ring]) <= width)
    flat = local[:, :2] / np.hypot(local[:, 0], local[:, 1])[:, None]
    normals = projector.light.ring_normals(flat, rho)
    outward = normals @ projector.world_from_ring[:3, :3].T
    root = np.where(np.einsum("ij,ij->i", outward, rays) > 0.0, 1, -1)
    return np.where(on_ring, ring, -1), root.astype(np.int8)
