"""Pattern frames as grey images of a projector's own resolution.

Edges are anti-aliased: a pixel that a ring edge crosses gets the share of it that is
bright, (rho - R) / |grad rho| + 1/2 held within [0, 1], with rho the ring coordinate of
its centre. Half way between, frame and inverse are equally bright, whatever the
projector's gamma.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)

from .ring_patterns import DrawnRings, Frame

_WHITE = 255.0


@dataclass(frozen=True, eq=False)
class PatternCanvas:
    """Where a projector's pixels lie among the rings, shape (h, w) each.

    Attributes:
        pattern: What is drawn.
        edge: Ring edge that is nearest in the ring coordinate.
        within: Grey level of the part of the pixel that lies inside that edge.
        beyond: Of the part outside it; both together are the pixel in white.
        outside: Of the part outside a camera's root disc, by its id: r.m > 0.
    """

    pattern: DrawnRings
    edge: NDArray[np.intp]
    within: NDArray[np.uint8]
    beyond: NDArray[np.uint8]
    outside: dict[str, NDArray[np.uint8]]

    def image(self, frame: Frame) -> NDArray[np.uint8]:
        """Return a frame's grey levels, 0 to 255, shape (h, w)."""
        if frame.kind == "root":
            assert frame.camera is not None
            outside = self.outside[frame.camera]
            return self.within + self.beyond - outside if frame.inverse else outside
        bright = self.pattern.bright(frame).astype(np.uint8)
        inside = self.within * bright[:-1].take(self.edge)
        return inside + self.beyond * bright[1:].take(self.edge)


def canvas(
    projector: ProjectorCalibration, cameras: Sequence[CameraCalibration]
) -> PatternCanvas:
    """Return where a projector's pixels lie among its rings, for a rig's cameras."""
    patterns = projector.pattern
    width, height = projector.resolution
    v, u = np.indices((height, width), dtype=np.float64)
    pixels = np.column_stack([u.ravel(), v.ravel()])
    x, y = (axis.reshape(height, width) for axis in projector.ring_plane(pixels).T)
    rho = np.hypot(x, y)
    slope = _slope(rho)
    radii = patterns.radii
    edge = np.searchsorted(0.5 * (radii[1:] + radii[:-1]), rho)
    drawn = _share(patterns.outer_radius - rho, slope)
    if projector.beam_radius is not None:
        flat = projector.panel_coordinates(pixels)
        away = np.hypot(flat[:, 0], flat[:, 1]).reshape(height, width)
        drawn = drawn * _share(projector.beam_radius - away, _slope(away))
    white = np.rint(_WHITE * drawn).astype(np.uint8)
    beyond = np.rint(white * _share(rho - radii[edge], slope)).astype(np.uint8)
    outside: dict[str, NDArray[np.uint8]] = {}
    for camera in cameras:
        level = projector.pattern_for(camera).root_level(x, y)
        share = _share(level, _slope(level)).astype(np.float32)
        outside[camera.id] = np.rint(white * share).astype(np.uint8)
    return PatternCanvas(patterns, edge, white - beyond, beyond, outside)


def _slope(values: Array) -> Array:
    """Return |grad| in units a pixel, never 0."""
    down, across = np.gradient(values)
    return np.maximum(np.hypot(across, down), np.finfo(float).tiny)


def _share(signed: Array, slope: Array) -> Array:
    """Return the share of a pixel beyond the border where a quantity is zero."""
    return np.clip(signed / slope + 0.5, 0.0, 1.0)
