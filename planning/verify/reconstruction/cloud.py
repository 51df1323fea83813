"""Measured points and what the scanner knows of each."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths

from .arrays import Array, Columns

# Error of a normal that is estimated from the points around [rad].
_NORMAL_RAD = 0.1


@dataclass(frozen=True, eq=False)
class Cloud(Columns):
    """Points triangulated from ring edges, or from coded pixels.

    What is said of edges is of coded pixels their code along the epipolar line, in
    pixels of the projector, or of the second camera.

    Attributes:
        points: In the world [m], shape (n, 3).
        rays: Unit viewing directions that measured them, shape (n, 3).
        beams: Unit directions of the light there, shape (n, 3).
        pixels: Sub-pixel positions (u, v) in the camera's image, shape (n, 2).
        camera: Index of the camera, shape (n,).
        projector: Index of the projector, shape (n,).
        ring: Index of the ring edge; -1: of a coded pixel; -2 - k: of a coded pixel
            that camera k sees, too, whose viewing rays are the `beams`, shape (n,).
        conditioning: r.m; of coded pixels the sine of the triangulation angle, (n,).
        shift: Displacement of the point when its edge moves by one pixel across itself,
            in [m/px], shape (n, 3).
        noise_px: Standard deviation of the edge's position across itself [px], (n,).
        blur_px: That of the edge's blur [px]; NaN: unknown, shape (n,).
        bias_px: What the edge may be off beside its noise, across itself, the same in
            every image: standard deviation [px], shape (n,).
    """

    points: Array
    rays: Array
    beams: Array
    pixels: Array
    camera: NDArray[np.int16]
    projector: NDArray[np.int16]
    ring: NDArray[np.int16]
    conditioning: Array
    shift: Array
    noise_px: Array
    blur_px: Array
    bias_px: Array

    @property
    def by_camera(self) -> NDArray[np.int16]:
        """Second camera of points that two cameras measured; negative: none, (n,)."""
        return (-2 - self.ring).astype(np.int16)

    def of_devices(self, projector: int, camera: int) -> "Cloud":
        """Return the points with these indices of their devices."""
        return replace(
            self,
            projector=np.full(len(self), projector, dtype=np.int16),
            camera=np.full(len(self), camera, dtype=np.int16),
        )

    def thinned(self, most: int) -> "Cloud":
        """Return at most so many of the points, evenly."""
        step = max(1, -(-len(self) // most))
        return self.take(np.arange(0, len(self), step))

    def sigma(self, normals: Array) -> Array:
        """Return the standard deviation [m] of each point along a normal, (n,).

        Grey noise isn't all: edges are biased, and normals are estimated from few
        points around. Without both the surest points would seem surer than they are
        (docs/method/accuracy.md).
        """
        return self.per_pixel(normals) * np.hypot(self.noise_px, self.bias_px)

    def per_pixel(self, normals: Array) -> Array:
        """Return how far each point moves along a normal with its edge [m/px], (n,).

        At least a share of all that it moves, for normals are estimated.
        """
        along = np.einsum("ij,ij->i", self.shift, normals)
        return np.hypot(along, _NORMAL_RAD * lengths(self.shift))

    @staticmethod
    def empty() -> "Cloud":
        """Return a cloud of no points."""
        vectors, numbers = np.zeros((0, 3)), np.zeros(0)
        pixels, index = np.zeros((0, 2)), np.zeros(0, dtype=np.int16)
        places, devices = (vectors, vectors, vectors, pixels), (index, index, index)
        columns = numbers, vectors, numbers, numbers, numbers
        return Cloud(*places, *devices, *columns)
