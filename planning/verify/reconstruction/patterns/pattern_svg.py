"""Pattern frames as curves: each ring edge is a conic in the projector's image.

A circle of the ring plane, p^T Q p = 0, is seen through the homography H from ring
plane to pixels, so its image is the conic H^-T Q H^-1. Ellipses are written as such,
exact to the last written digit; other conics, which only a cone of more than 90 degrees
about the image's normal gives, as polygons that stray by at most `TOLERANCE_PX`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.calibration import ProjectorCalibration

from .pattern_frames import Frame, PatternSequence
from .ring_patterns import RingPatterns

TOLERANCE_PX = 0.01
_FILL = {False: "#000", True: "#fff"}
_FIRST_POINTS = 65
_MOST_POINTS = 1 << 16
# In the plane of the rings: nearer to the device's own plane nothing is drawn.
_BEHIND = 1e-4
# Least o_z of a camera, as a share of its distance from the ring axis.
_FLATTEST = 1e-7


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle of the ring plane.

    Attributes:
        centre: In the plane, shape (2,).
        radius: Its radius.
    """

    centre: NDArray[np.float64]
    radius: float


@dataclass(frozen=True, eq=False)
class VectorFrames:
    """A projector's frames as SVG images, one unit a pixel.

    Attributes:
        sequence: What is shown.
    """

    sequence: PatternSequence

    def svg(self, frame: Frame) -> str:
        """Return a frame as an SVG image; pixel centres are at whole numbers."""
        width, height = self.sequence.projector.resolution
        whole = f'x="-0.5" y="-0.5" width="{width}" height="{height}"'
        shapes = "\n".join(self._painted(frame))
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" '
            f'height="{height}" viewBox="-0.5 -0.5 {width} {height}">\n'
            f'<clipPath id="beam">{_beam(self.sequence.projector)}</clipPath>\n'
            f'<clipPath id="drawn"><{self._outside}/></clipPath>\n'
            f'<rect {whole} fill="#000"/>\n'
            f'<g clip-path="url(#beam)"><g clip-path="url(#drawn)">\n'
            f"{shapes}\n</g></g>\n</svg>\n"
        )

    def _painted(self, frame: Frame) -> Iterator[str]:
        """What is painted, from the outside inwards."""
        if frame.kind == "root":
            assert frame.camera is not None
            disc, bright = _disc(self.sequence.patterns[frame.camera])
            inside = bright != frame.inverse
            yield _filled(self._outside, not inside)
            yield _filled(self._curve(disc), inside)
            return
        levels = self.sequence.annulus_levels(frame)
        yield _filled(self._outside, bool(levels[-1]))
        for ring in np.flatnonzero(levels[1:] != levels[:-1])[::-1]:
            yield _filled(self._edges[ring], bool(levels[ring]))

    @cached_property
    def _pixels(self) -> NDArray[np.float64]:
        return pixels_from_plane(self.sequence.projector)

    @cached_property
    def _outside(self) -> str:
        return self._about_axis(self.sequence.rings.outer_radius)

    @cached_property
    def _edges(self) -> list[str]:
        return [self._about_axis(float(r)) for r in self.sequence.rings.radii]

    def _about_axis(self, radius: float) -> str:
        return self._curve(Circle(np.zeros(2), radius))

    def _curve(self, circle: Circle) -> str:
        return _curve(circle, self._pixels, self.sequence.projector.resolution)


def pixels_from_plane(projector: ProjectorCalibration) -> NDArray[np.float64]:
    """Return the homography H from the plane of the rings to pixels, shape (3, 3)."""
    pose = projector.ring_from_device
    if projector.light == "parallel":
        plane = np.eye(3)
        plane[:2, :2], plane[:2, 2] = pose[:2, :2], pose[:2, 3]
    else:
        plane = pose[:3, :3]
    return projector.matrix @ np.linalg.inv(plane)


def ellipse_of(
    circle: Circle, pixels: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
    """Return the image of a circle: centre and semi-axes in [px], turn in [rad].

    Args:
        circle: In the plane of the rings.
        pixels: Homography from that plane to pixels.

    Returns:
        None if the image is no ellipse.
    """
    x, y = circle.centre
    conic = np.array(
        [[1.0, 0.0, -x], [0.0, 1.0, -y], [-x, -y, x * x + y * y - circle.radius**2]]
    )
    back = np.linalg.inv(pixels)
    conic = back.T @ conic @ back
    quadratic, linear = conic[:2, :2], conic[:2, 2]
    if not np.linalg.det(quadratic) > 0.0:
        return None
    centre = -np.linalg.solve(quadratic, linear)
    level = -(conic[2, 2] + linear @ centre)
    values, axes = np.linalg.eigh(quadratic * np.sign(level))
    half = np.sqrt(np.abs(level) / values)
    turn = float(np.arctan2(axes[1, 0], axes[0, 0]))
    return np.asarray(centre, dtype=np.float64), np.asarray(half), turn


def outline_of(
    circle: Circle, pixels: NDArray[np.float64], resolution: tuple[int, int]
) -> NDArray[np.float64]:
    """Return a polygon that is the image of a disc within a projector's image.

    Of the disc, what lies behind the device is cut off: by the line w = `_BEHIND` of
    the plane, which lands far outside the image. Near the image the polygon strays from
    the curve by at most `TOLERANCE_PX`.

    Args:
        circle: Border of the disc, in the plane of the rings.
        pixels: Homography from that plane to pixels.
        resolution: Width and height of the image.

    Returns:
        Corners in [px], shape (n, 2).
    """
    middle, diagonal = 0.5 * (np.array(resolution) - 1.0), float(np.hypot(*resolution))
    # w = a + m cos(turn - start) along the circle, of which w > 0 is one arc.
    row = pixels[2] / np.linalg.norm(pixels[2])
    reach = circle.radius * float(np.hypot(row[0], row[1]))
    start = float(np.arctan2(row[1], row[0]))
    room = (_BEHIND - row[:2] @ circle.centre - row[2]) / max(reach, 1e-300)
    half = float(np.arccos(np.clip(room, -1.0, 1.0)))
    turns = start + np.linspace(-half, half, _FIRST_POINTS)
    while len(turns) < _MOST_POINTS:
        corners = _on_circle(circle, turns, pixels)
        halves = 0.5 * (turns[1:] + turns[:-1])
        bow = np.linalg.norm(
            _on_circle(circle, halves, pixels) - 0.5 * (corners[1:] + corners[:-1]),
            axis=1,
        )
        away = _distance(middle, corners[:-1], corners[1:])
        coarse = bow > np.where(away < 2.0 * diagonal, TOLERANCE_PX, 0.25 * away)
        if not coarse.any():
            break
        turns = np.sort(np.concatenate([turns, halves[coarse]]))
    return _on_circle(circle, turns, pixels)


def _disc(patterns: RingPatterns) -> tuple[Circle, bool]:
    """The root disc, and whether it is bright inside.

    |p|^2 o_z = o_x p_x + o_y p_y (diverging; o_z = 1 in parallel light) is the circle
    over the segment from the ring axis to o / o_z.
    """
    x, y, z = patterns.camera_in_ring
    depth = float(z) if patterns.light == "diverging" else 1.0
    # A camera in the projector's own plane has a half plane: so large a disc.
    least = _FLATTEST * float(np.hypot(x, y))
    if abs(depth) < least:
        depth = float(np.copysign(least, depth))
    centre = np.array([x, y]) / (2.0 * depth)
    return Circle(centre, float(np.hypot(*centre))), depth < 0.0


def _beam(projector: ProjectorCalibration) -> str:
    """What leaves the device, as an element: its image, or the round beam in it."""
    width, height = projector.resolution
    if projector.beam_radius is None:
        return f'<rect x="-0.5" y="-0.5" width="{width}" height="{height}"/>'
    u, v = projector.matrix[:2, 2]
    radius = projector.beam_radius * projector.matrix[0, 0]
    return f'<circle cx="{u:.6f}" cy="{v:.6f}" r="{radius:.6f}"/>'


def _filled(curve: str, bright: bool) -> str:
    return f'<{curve} fill="{_FILL[bright]}"/>'


def _curve(
    circle: Circle, pixels: NDArray[np.float64], resolution: tuple[int, int]
) -> str:
    """The image of a disc of the ring plane: name and attributes of an element."""
    found = ellipse_of(circle, pixels) if _all_in_front(circle, pixels) else None
    if found is None:
        corners = outline_of(circle, pixels, resolution)
        return f'polygon points="{" ".join(f"{u:.4f},{v:.4f}" for u, v in corners)}"'
    (u, v), (a, b), turn = found
    return (
        f'ellipse rx="{a:.6f}" ry="{b:.6f}" transform="translate({u:.6f} {v:.6f}) '
        f'rotate({np.degrees(turn):.9f})"'
    )


def _all_in_front(circle: Circle, pixels: NDArray[np.float64]) -> bool:
    row = pixels[2]
    reach = circle.radius * np.hypot(row[0], row[1])
    return bool(row[:2] @ circle.centre + row[2] - reach > 0.0)


def _on_circle(
    circle: Circle, turns: NDArray[np.float64], pixels: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Pixels of points on a circle of the ring plane, shape (n, 2)."""
    spoke = np.column_stack([np.cos(turns), np.sin(turns)])
    plane = np.column_stack(
        [circle.centre + circle.radius * spoke, np.ones(len(turns))]
    )
    u, v, w = pixels @ plane.T
    return np.column_stack([u / w, v / w])


def _distance(
    point: NDArray[np.float64], begin: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance of a point from segments, shape (n,)."""
    along = end - begin
    square = np.maximum(np.sum(along * along, axis=1), 1e-300)
    share = np.clip(np.sum((point - begin) * along, axis=1) / square, 0.0, 1.0)
    return np.linalg.norm(begin + share[:, None] * along - point, axis=1)
