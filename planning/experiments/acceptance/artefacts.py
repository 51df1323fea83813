"""Artefacts of VDI/VDE 2634 part 2 in a plan's measuring volume, and their places.

The volume is the cube in the ball about the object that the rig was planned for; L0,
its diagonal, is the ball's diameter. Sizes are the least that the guideline allows, so
that all artefacts fit: spheres of 0.1 L0, 0.3 L0 from centre to centre, plates 0.5 L0
long, as laboratories quote it; the guideline itself is sold, and wasn't at hand.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import box, sphere
from planning.verify.reconstruction.scanner import Scanner

SPHERE, BAR, PLATE = 0.1, 0.3, 0.5
# Width and thickness of a plate as shares of its length.
_WIDTH, _THICKNESS = 0.5, 0.08
# Facets lie within 1 um of a sphere of 26 mm.
_SUBDIVISIONS = 6
# Plates are turned about their own axes by up to so much from the light [rad].
_TILT = np.deg2rad(20.0)
N_PLATES = 6


@dataclass(frozen=True, eq=False)
class Bar:
    """Two spheres of calibrated radius and distance.

    Attributes:
        centres: Of both in the world [m], shape (2, 3).
        radius: Of each [m].
    """

    centres: Array
    radius: float

    @property
    def length(self) -> float:
        """From centre to centre [m]."""
        return float(np.linalg.norm(self.centres[1] - self.centres[0]))

    def mesh(self) -> TriangleMesh:
        """Return both spheres."""
        ball = sphere(self.radius, subdivisions=_SUBDIVISIONS)
        moved = (TriangleMesh(ball.vertices + c, ball.faces) for c in self.centres)
        return TriangleMesh.joined(list(moved))


@dataclass(frozen=True, eq=False)
class Plate:
    """A flat plate.

    Attributes:
        pose: World from plate, whose face is z = 0, seen from +z, shape (4, 4).
        size: Length, width and thickness [m].
    """

    pose: Array
    size: tuple[float, float, float]

    def mesh(self) -> TriangleMesh:
        """Return the plate, its face up."""
        plain = box(self.size)
        lowered = plain.vertices - [0.0, 0.0, 0.5 * self.size[2]]
        turned = lowered @ self.pose[:3, :3].T + self.pose[:3, 3]
        return TriangleMesh(turned, plain.faces)


def bars(scanner: Scanner) -> Iterator[Bar]:
    """Yield seven places of the bar: along the cube's four diagonals and three edges.

    Each in a place of its own, so that their fourteen spheres fill the volume.
    """
    centre, ball = scanner.mesh.centre, scanner.mesh.radius
    # Half a bar and a sphere stay inside the ball.
    free = ball * (1.0 - BAR - SPHERE)
    corners = np.array([(1.0, b, c) for b, c in product((-1.0, 1.0), repeat=2)])
    ways = np.vstack([corners / np.sqrt(3.0), np.eye(3)])
    for k, way in enumerate(ways):
        # Aside from its direction, alternately to either side.
        aside = np.cross(way, ways[(k + 1) % len(ways)])
        aside *= (-1) ** k * 0.5 * free / np.linalg.norm(aside)
        ends = np.array([[-1.0], [1.0]]) * BAR * ball * way
        yield Bar(centre + aside + ends, SPHERE * ball)


def plates(scanner: Scanner) -> Iterator[Plate]:
    """Yield six places of the plate, which faces pairs of devices in turn.

    Its normal halves the angle between projector and camera, tilted by 20 degrees to
    either side every other time; its middle lies before or behind the centre.
    """
    centre, ball = scanner.mesh.centre, scanner.mesh.radius
    length = 2.0 * PLATE * ball
    size = (length, _WIDTH * length, _THICKNESS * length)
    pairs = _facing(scanner)
    for k in range(N_PLATES):
        normal = pairs[k % len(pairs)]
        across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        across /= np.linalg.norm(across)
        turn = k // len(pairs) % 3 - 1
        tilt = Rotation.from_rotvec(turn * _TILT * across).as_matrix()
        pose = np.eye(4)
        pose[:3, :3] = tilt @ np.column_stack(
            [across, np.cross(normal, across), normal]
        )
        pose[:3, 3] = centre + (-1) ** k * 0.25 * ball * normal
        yield Plate(pose, size)


def _facing(scanner: Scanner) -> list[Array]:
    """Directions halfway between projectors and the camera nearest each in angle."""
    centre, found = scanner.mesh.centre, []
    eyes = [_unit(camera.centre - centre) for camera in scanner.cameras]
    for projector in scanner.projectors:
        light = -projector.aim(centre[None])[1][0]
        nearest = max(eyes, key=lambda eye, light=light: float(eye @ light))
        found.append(_unit(light + nearest))
    return found


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)
