"""Pattern frames as grey images of a projector's own resolution.

Edges are anti-aliased: a pixel that a ring edge crosses gets the share of it that is
bright, (rho - R) / |grad rho| + 1/2 held within [0, 1], with rho the ring coordinate of
its centre. Half way between, frame and inverse are equally bright, whatever the
projector's gamma.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)

from .ring_patterns import DrawnRings, Frame, RingsForCamera

_WHITE = 255.0


@dataclass(frozen=True, eq=False)
class PatternCanvas:
    """Where a projector's pixels lie among the rings, shape (h, w) each.

    Attributes:
        pattern: What is drawn.
        discs: The same with the root disc of each camera, by its id.
        x: Of pixel centres in the plane of the rings.
        y: Likewise.
        edge: Ring edge that is nearest in the ring coordinate.
        within: Grey level of the part of the pixel that lies inside that edge.
        beyond: Of the part outside it; both together are the pixel in white.
    """

    pattern: DrawnRings
    discs: dict[str, RingsForCamera]
    x: Array
    y: Array
    edge: NDArray[np.intp]
    within: NDArray[np.uint8]
    beyond: NDArray[np.uint8]

    def image(self, frame: Frame) -> NDArray[np.uint8]:
        """Return a frame's grey levels, 0 to 255, shape (h, w)."""
        if frame.kind == "root":
            assert frame.camera is not None
            outside = self._outside[frame.camera]
            return self.within + self.beyond - outside if frame.inverse else outside
        bright = self.pattern.bright(frame).astype(np.uint8)
        inside = self.within * bright[:-1].take(self.edge)
        return inside + self.beyond * bright[1:].take(self.edge)

    @cached_property
    def _outside(self) -> dict[str, NDArray[np.uint8]]:
        """Where r.m > 0, by camera: outside its root disc."""
        white = self.within + self.beyond
        outside: dict[str, NDArray[np.uint8]] = {}
        for camera, patterns in self.discs.items():
            level = patterns.root_level(self.x, self.y)
            share = _share(level, _slope(level)).astype(np.float32)
            outside[camera] = np.rint(white * share).astype(np.uint8)
        return outside


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
    discs = {camera.id: projector.pattern_for(camera) for camera in cameras}
    return PatternCanvas(patterns, discs, x, y, edge, white - beyond, beyond)


def _slope(values: Array) -> Array:
    """Return |grad| in units a pixel, never 0."""
    down, across = np.gradient(values)
    return np.maximum(np.hypot(across, down), np.finfo(float).tiny)


def _share(signed: Array, slope: Array) -> Array:
    """Return the share of a pixel beyond the border where a quantity is zero."""
    return np.clip(signed / slope + 0.5, 0.0, 1.0)
