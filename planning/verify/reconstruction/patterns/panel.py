"""What a projector's pixels show: squares of one grey level each.

A ring edge is drawn as the covered area of each pixel, averaged over two pixels across
the edge. With d the distance of the pixel's centre from the edge [px], (rho - R) /
|grad rho| of the ring coordinate, and q(x) = max(x, 0)^2 / 2, its share of white is::

    (q(d + 3/2) - q(d + 1/2) - q(d - 1/2) + q(d - 3/2)) / 2

Squares of the covered area alone leave edges 0.030 px off (rms) where all blur is 0.5
px, and 0.014 where it is 0.7; averaged over whole pixels the lattice hardly shows,
0.003 and 0.004 px (`benchmarks/pixels/panel_edges.py`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Grey, Indices, Mask
from planning.verify.reconstruction.calibration import ProjectorCalibration

from .response import WHITE, Response
from .ring_patterns import DrawnRings, Frame, RingsForCamera


@dataclass(frozen=True)
class PanelWindow:
    """A part of the panel: its top-left pixel (u, v), and how many there are."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class PanelCanvas:
    """Where a projector's pixels lie among the rings, shape (h, w) each.

    Attributes:
        window: Which pixels these are.
        annulus: In which the centre of each lies.
        inner: Share of its light that is of the next annulus inwards.
        outer: Of the next one outwards.
        drawn: Share that is drawn at all.
        outside: Share outside a camera's root disc, by its id: r.m > 0.
    """

    window: PanelWindow
    annulus: Indices
    inner: Grey
    outer: Grey
    drawn: Grey
    outside: dict[str, Grey]

    @classmethod
    def of(
        cls,
        projector: ProjectorCalibration,
        pattern: DrawnRings,
        cameras: dict[str, RingsForCamera],
        window: PanelWindow | None = None,
    ) -> "PanelCanvas":
        """Return where a projector's pixels lie among rings; all without a window."""
        window = window or PanelWindow(0, 0, *projector.resolution)
        v, u = np.indices((window.height, window.width), dtype=np.float64)
        pixels = np.column_stack([u.ravel() + window.left, v.ravel() + window.top])
        x, y = (axis.reshape(u.shape) for axis in projector.ring_plane(pixels).T)
        rho = np.hypot(x, y)
        slope = _slope(rho)
        annulus = np.searchsorted(pattern.radii, rho)
        edges = np.concatenate([[-np.inf], pattern.radii, [np.inf]])
        drawn = _share(pattern.outer_radius - rho, slope)
        width, height = projector.resolution
        across, down = u + window.left, v + window.top
        drawn *= (across >= 0) & (across < width) & (down >= 0) & (down < height)
        if projector.beam_radius is not None:
            flat = projector.panel_coordinates(pixels)
            away = np.hypot(flat[:, 0], flat[:, 1]).reshape(u.shape)
            drawn *= _share(projector.beam_radius - away, _slope(away))
        levels = {name: rings.root_level(x, y) for name, rings in cameras.items()}
        return cls(
            window,
            annulus,
            _share(edges[annulus] - rho, slope),
            _share(rho - edges[annulus + 1], slope),
            drawn,
            {name: _share(level, _slope(level)) for name, level in levels.items()},
        )

    def shares(self, bright: Grey) -> Grey:
        """Return the light of each pixel as a share of white's, by that of annuli."""
        inwards = np.concatenate([bright[:1], bright[:-1]]) - bright
        outwards = np.concatenate([bright[1:], bright[-1:]]) - bright
        k = self.annulus
        level = bright[k] + inwards[k] * self.inner + outwards[k] * self.outer
        return np.asarray(self.drawn * level, dtype=np.float32)

    def levels(self, bright: Mask, response: Response) -> NDArray[np.uint8]:
        """Return the grey levels of a frame whose annuli are bright or dark, (h, w)."""
        places, beside = self._beside_borders
        levels = (bright * np.uint8(WHITE)).take(self.annulus)
        levels[self.drawn == 0.0] = 0
        shares = beside.shares(bright.astype(np.float32))
        levels.ravel()[places] = response.levels(shares)
        return levels

    @cached_property
    def _beside_borders(self) -> tuple[Indices, "PanelCanvas"]:
        """Pixels that more than one annulus, or what isn't drawn, has a share of."""
        whole = (self.drawn == 0.0) | (self.drawn == 1.0)
        whole &= (self.inner == 0.0) & (self.outer == 0.0)
        places = np.flatnonzero(~whole)
        shares = (self.inner, self.outer, self.drawn)
        inner, outer, drawn = (share.ravel()[places] for share in shares)
        annulus = self.annulus.ravel()[places]
        return places, PanelCanvas(self.window, annulus, inner, outer, drawn, {})


def frame_levels(
    canvas: PanelCanvas, pattern: DrawnRings, frame: Frame, response: Response
) -> NDArray[np.uint8]:
    """Return the grey levels of a frame, 0 to 255, shape (h, w).

    An inverse is what white has more than its frame, in light.
    """
    if frame.inverse:
        shown = frame_levels(canvas, pattern, replace(frame, inverse=False), response)
        return response.left(response.levels(canvas.drawn), shown)
    if frame.kind == "root":
        assert frame.camera is not None
        return response.levels(canvas.drawn * canvas.outside[frame.camera])
    return canvas.levels(pattern.bright(frame), response)


def _slope(values: Array) -> Array:
    """Return |grad| in units a pixel, never 0."""
    down, across = np.gradient(values)
    return np.maximum(np.sqrt(across**2 + down**2), np.finfo(float).tiny)


def _share(signed: Array, slope: Array) -> Grey:
    """Return the share beyond the border where a quantity is zero."""
    away = signed / slope
    share = (away > 0.0).astype(np.float32)
    near = np.abs(away) < 1.5
    parts = (np.maximum(away[near] + x, 0.0) ** 2 for x in (1.5, 0.5, -0.5))
    first, second, third = parts
    share[near] = 0.25 * (first - second - third)
    return share
