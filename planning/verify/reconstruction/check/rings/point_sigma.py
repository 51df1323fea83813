"""How far merged points lie off, term by term, when their lines have averaged them.

Of a line's weights w, which are 1 / sigma^2 of edge noise:

- noise: a share `remaining` of the point's own is left, ``1 / sqrt(sum 1 / sigma^2)``,
  along its normal, or what is left of it along the light, whichever is more;
- what light does to an edge every camera sees, and at neighbouring places much alike:
  the panel's squares, brightness that changes. It isn't averaged, but weighted:
  ``sum w b / sum w`` of displacements b along the normal, whose sign is that of the
  ring's side from which a camera looks;
- what else moves points off their lines by d, the object's own shape in the first
  place, shows in d^2 beyond the variance of what was averaged away;
- relief, which no line shows that bends as it: see `plane_normals`.
"""

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.check.tiles import Tiles, plane_normals
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .lattice import PanelEffects
from .ring_fit import RingFit

# From here on it isn't noise but doubt of a pair, which no average makes less [px].
_DOUBT_PX = 0.5


@dataclass(frozen=True, eq=False)
class Sigmas:
    """Points on their lines, and how surely they lie there.

    Attributes:
        cloud: The points, moved; its noise and bias are what is left of theirs.
        normals: By the points around, towards the camera; NaN: too few, shape (n, 3).
        sigma: Standard deviation along the normal [m]; NaN likewise, shape (n,).
    """

    cloud: Cloud
    normals: Array
    sigma: Array

    @classmethod
    def of(
        cls,
        cloud: Cloud,
        fit: RingFit,
        plan: Scanner,
        *,
        doubtful: Mask,
        steps: Mask,
        pitch_px: float,
    ) -> "Sigmas":
        """Move points onto their lines.

        Args:
            cloud: As measured.
            fit: Their lines.
            plan: Whose devices measured them.
            doubtful: Which may lie in a step, so anywhere between two rings, (n,).
            steps: Which do, and go, shape (n,).
            pitch_px: About how far rings are apart in images.
        """
        noise_px = np.where(doubtful, pitch_px / np.sqrt(12.0), cloud.noise_px)
        # What a pair is off by stays.
        certain = ~doubtful & (noise_px < _DOUBT_PX)
        remaining = np.where(certain, fit.remaining, 1.0)
        onto = cloud.points + fit.shift[:, None] * cloud.beams
        moved = replace(cloud, points=onto, noise_px=noise_px * remaining)
        normals, relief = np.full((len(cloud), 3), np.nan), np.zeros(len(cloud))
        seen = _by_camera(cloud, ~steps, pitch_px)
        for rows, tiles in seen:
            planes = plane_normals(onto[rows], cloud.rays[rows], tiles)
            normals[rows], relief[rows] = planes
        panel = PanelEffects.of(moved, normals, plan)
        off = np.stack([cloud.bias_px, panel.lattice_px])
        a_pixel = moved.per_pixel(normals)
        side = np.sign(np.einsum("ij,ij->i", cloud.shift, normals))
        off *= np.nan_to_num(np.where(doubtful, 0.0, side * a_pixel))
        left = np.stack([fit.averaged(row) for row in off])
        facing = np.einsum("ij,ij->i", cloud.beams, normals)
        # Where slopes of rings and normals don't agree, the larger of both counts.
        by_line, told = np.zeros(len(cloud)), certain & (a_pixel > 0.0)
        np.divide(fit.noise * np.abs(facing), a_pixel, out=by_line, where=told)
        moved = replace(moved, noise_px=np.maximum(moved.noise_px, by_line))
        apart = fit.shift * facing
        gone = np.square(noise_px * a_pixel) * (1.0 - remaining**2)
        square = np.square(apart) - np.square(off - left).sum(axis=0)
        for rows, tiles in seen:
            more = tiles.excess_around(square[rows], gone[rows])
            relief[rows] = np.sqrt(relief[rows] ** 2 + more)
        # Where there is no normal, no displacement along one tells what is left of it.
        bias_px = np.where(doubtful, 0.0, cloud.bias_px)
        lies, told = np.linalg.norm(left, axis=0), ~doubtful & (a_pixel > 0.0)
        np.divide(lies, a_pixel, out=bias_px, where=told)
        outwards = onto - panel.inwards[:, None] * cloud.rays
        moved = replace(moved, bias_px=bias_px, points=outwards)
        # In a step there is no surface whose normal would make an error less.
        largest = lengths(moved.shift) * moved.noise_px
        sigma = np.where(doubtful, largest, np.hypot(moved.sigma(normals), relief))
        return cls(moved, normals, sigma)


def _by_camera(
    cloud: Cloud, chosen: Mask, pitch_px: float
) -> list[tuple[Indices, Tiles]]:
    """Return the chosen points of each camera, and the tiles of its image."""
    cameras = np.unique(cloud.camera[chosen])
    seen = [np.flatnonzero(chosen & (cloud.camera == camera)) for camera in cameras]
    return [(rows, Tiles.of(cloud.pixels[rows], pitch_px)) for rows in seen]
