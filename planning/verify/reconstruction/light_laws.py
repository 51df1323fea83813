"""The two kinds of light: the paper's parallel beam, and a pinhole's diverging rays.

What depends on which one it is stands here and nowhere else in this checker. In the
frame of a device or of its rings, light is told by where it crosses a plane: p = (x, y)
in [m] in parallel light, p = (x/z, y/z) in diverging light. A ring is |p| = R: a
cylinder or a cone about the ring axis.
"""

from typing import Literal

import numpy as np

from geometry.arrays import lengths

from .arrays import Array, Mask

LightName = Literal["diverging", "parallel"]


class LightLaw:
    """Parallel light along +z from the plane z = 0; `_Diverging` says what differs.

    Attributes:
        name: As in a plan.
        offset_column: Of a transform (4, 4) that adds to p: the translation's, or z's.
    """

    name: LightName = "parallel"
    offset_column = 3

    def shrink(self, depth: Array) -> Array:
        """Return p in units of (x, y) at depths z [m], shape (n,): 1, or 1 / z."""
        return np.ones_like(depth)

    def turned(self, p: Array, b_from_a: Array) -> Array:
        """Return the light p (n, 2) of frame a in frame b, its pose of shape (4, 4)."""
        return p @ b_from_a[:2, :2].T + b_from_a[:2, 3]

    def turned_slopes(self, p: Array, slopes: Array, b_from_a: Array) -> Array:
        """Return by light p (n, 2) of frame a what changes by slopes (n, 2) in b."""
        return slopes @ b_from_a[:2, :2]

    def plane_slopes(self, local: Array, slopes: Array) -> Array:
        """Return by points (n, 3) what changes by slopes (n, 2) with their p."""
        return np.column_stack([slopes, np.zeros(len(local))])

    def rays(self, p: Array, pose: Array) -> tuple[Array, Array]:
        """Return origins [m] and unit directions (n, 3) of light p of a posed frame."""
        starts = pose[:3, 3] + p @ pose[:3, :2].T
        return starts, np.broadcast_to(pose[:3, 2], starts.shape)

    def aim(
        self, pose: Array, points: Array, depth: Array
    ) -> tuple[Array, Array, Array]:
        """Return where the light of world points (n, 3) starts, and how it runs.

        Origins [m], (3,) or (n, 3); unit directions (n, 3); lengths [m] (n,), all of
        points at depths z [m] (n,) before the device.
        """
        beams = np.broadcast_to(pose[:3, 2], points.shape)
        return points - depth[:, None] * beams, beams, depth

    def falloff(self, depth: Array) -> Array | float:
        """Return the brightness at depths, 1 at their median, shape (n,)."""
        return 1.0

    def across_m(self, step: Array, rho: Array, depth: Array) -> Array:
        """Return steps of |p| at rho and depth z as lengths across the beam [m].

        In diverging light a step is ``z / sqrt(1 + rho^2)`` times as long.
        """
        return step

    def quadric(self, radii: Array) -> tuple[Array | float, Array | float]:
        """Return k and c of the ring surfaces ``x^2 + y^2 = k z^2 + c``."""
        return 0.0, radii * radii

    def reaches(self, z: Array) -> Mask:
        """Return whether rings of light exist at z of the ring frame, shape (n,)."""
        return np.ones_like(z, dtype=bool)

    def root_weight(self, camera_z: float) -> float:
        """Return the factor of |p|^2 on the border of a root disc: 1, or o_z."""
        return 1.0

    def plane(self, local: Array) -> Array:
        """Return p (n, 2) at points (n, 3) in the frame of the device or its rings."""
        return local[:, :2]

    def off_light(self, local: Array, p: Array, moves: bool = False) -> Array:
        """Return how far points (n, 3) are across from the light p (n, 2), (n, 2).

        Linear in the points; ``(x, y) - p``, or ``(x, y) - p z``. Of what a point
        `moves` by, how much farther it is.
        """
        return local[:, :2] - (0.0 if moves else 1.0) * p

    def chart(self, depth: Array) -> Array:
        """Return the height z that is linear over |p| on a plane: z, or 1 / z."""
        return depth

    def chart_m(self, rho: Array, depth: Array) -> Array:
        """Return lengths along the beam [m] for one of the chart at depths z."""
        return np.ones_like(depth)

    def gradients(self, p: Array, depth: Array) -> Array:
        """Return the gradients of p in the frame [1/m], shape (n, 2, 3)."""
        return np.broadcast_to(np.eye(2, 3), (len(p), 2, 3))

    def slope_run(self, rho: Array, depth: Array) -> tuple[Array, Array]:
        """Return (s, t) whose |dt / ds| is tan(incidence) across rings: |p| and z.

        In diverging light the angle to the axis, and the logarithm of the length.
        """
        return rho, depth

    def ring_normals(self, outward: Array, rho: Array) -> Array:
        """Return unit normals (n, 3) of ring surfaces in the ring frame.

        At |p| = rho (n,), in unit directions (n, 2) away from the axis.
        """
        return np.column_stack([outward, np.zeros_like(rho)])


class _Diverging(LightLaw):
    """Rays from the optical centre; rings are cones."""

    name: LightName = "diverging"
    offset_column = 2

    def shrink(self, depth: Array) -> Array:
        return 1.0 / depth

    def turned(self, p: Array, b_from_a: Array) -> Array:
        x, y, z = b_from_a[:3, :2] @ p.T + b_from_a[:3, 2:3]
        return np.column_stack([x / z, y / z])

    def turned_slopes(self, p: Array, slopes: Array, b_from_a: Array) -> Array:
        towards = np.column_stack([p, np.ones(len(p))]) @ b_from_a[:3, :3].T
        return self.plane_slopes(towards, slopes) @ b_from_a[:3, :2]

    def plane_slopes(self, local: Array, slopes: Array) -> Array:
        along = -np.einsum("ij,ij->i", slopes, self.plane(local))
        return np.column_stack([slopes, along]) / local[:, 2:]

    def rays(self, p: Array, pose: Array) -> tuple[Array, Array]:
        beams = p @ pose[:3, :2].T + pose[:3, 2]
        beams /= lengths(beams)[:, None]
        return np.broadcast_to(pose[:3, 3], beams.shape), beams

    def aim(
        self, pose: Array, points: Array, depth: Array
    ) -> tuple[Array, Array, Array]:
        beams = points - pose[:3, 3]
        reach = np.sqrt(np.einsum("ij,ij->i", beams, beams))
        beams /= reach[:, None]
        return pose[:3, 3], beams, reach

    def falloff(self, depth: Array) -> Array | float:
        return (float(np.median(depth)) / depth) ** 2

    def off_light(self, local: Array, p: Array, moves: bool = False) -> Array:
        return local[:, :2] - p * local[:, 2:]

    def chart(self, depth: Array) -> Array:
        return 1.0 / depth

    def chart_m(self, rho: Array, depth: Array) -> Array:
        return depth**2 * np.sqrt(1.0 + rho**2)

    def gradients(self, p: Array, depth: Array) -> Array:
        slopes = np.tile(np.eye(2, 3), (len(p), 1, 1))
        slopes[:, :, 2] = -p
        return slopes / depth[:, None, None]

    def slope_run(self, rho: Array, depth: Array) -> tuple[Array, Array]:
        return np.arctan(rho), np.log(depth * np.sqrt(1.0 + rho**2))

    def ring_normals(self, outward: Array, rho: Array) -> Array:
        slope = np.sqrt(1.0 + rho * rho)[:, None]
        return np.column_stack([outward, -rho]) / slope

    def across_m(self, step: Array, rho: Array, depth: Array) -> Array:
        return step * depth / np.sqrt(1.0 + rho * rho)

    def quadric(self, radii: Array) -> tuple[Array | float, Array | float]:
        return radii * radii, 0.0

    def reaches(self, z: Array) -> Mask:
        return z > 0.0

    def root_weight(self, camera_z: float) -> float:
        return camera_z

    def plane(self, local: Array) -> Array:
        return local[:, :2] / local[:, 2:]


LIGHTS: dict[LightName, LightLaw] = {"parallel": LightLaw(), "diverging": _Diverging()}
