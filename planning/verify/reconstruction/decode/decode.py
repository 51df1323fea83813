"""Images to measured points, with no knowledge of the object."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera

from .code_map import CodeMap
from .edges import SATURATED, ImageEdges, find_edges
from .lit_image import LitImage
from .ring_chains import chains
from .triangulate import RingHits, intersect_rings

# Edges in a row that make a piece of surface. Single ones are often false, three hardly
# more often than a dozen, and ribs are but a few pixels wide.
_MIN_CHAIN = 3
# Share of the changes of one bit alone that must name a ring. Rings, however fine and
# dim, reach 0.95 in every bit, steps of depth included; in the frame that stands in
# another's place hardly any do. Between the two is an image disordered in part.
_MIN_NAMED = 1.0 / 3.0
# A bit is judged by more changes without a name than this share of all, and this many:
# where few rings flip it, steps of depth may outnumber them.
_UNNAMED_SHARE = 0.02
_UNNAMED_LEAST = 10
# tan(65 degrees) along a ring, tan(75 degrees) from ring to ring, where a gap is wide
# enough to mix surface with step.
_MAX_SLANT = 2.14
_STEPS_STEEPER = 1.74
# Saturated pixels that are kept as evidence, about.
_SATURATED_KEPT = 500
# Why an edge may give no point, in the order in which it is asked; outcomes count so.
CAUSES = (
    "labels",
    "no_intersection",
    "root",
    "conditioning",
    "outside_panel",
    "isolated",
    "depth_step",
    "unconfirmed",
)


# Indices of a projector and a camera of a rig.
PairIndex = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Decoded:
    """What one camera measured under one projector.

    Attributes:
        cloud: The points, with camera and projector index 0.
        lit_pixels: Pixels with enough contrast between white and black.
        n_edges: Edges found, whether a point came of them or not.
        rejected: Edges that gave no point, by cause.
        edges: All edges, for the search for causes.
        outcomes: Index in `CAUSES` of why each edge gave no point, -1 if it gave one,
            shape (n_edges,).
        n_saturated: Pixels that the white frame saturates.
        saturated: Some of them, (u, v) in the camera's image, shape (k, 2).
        lit: Which pixels show which annulus.
        codes: Which pixels show which pixel of a projector that codes them; None: it
            shows rings, or nothing.
        residual_px: Median distance at which rays of both devices pass each other
            [px of the projector]; NaN: of rings.
    """

    cloud: Cloud
    lit_pixels: int
    n_edges: int
    rejected: dict[str, int]
    edges: ImageEdges
    outcomes: NDArray[np.int8]
    n_saturated: int
    saturated: Array
    lit: LitImage
    codes: CodeMap | None = None
    residual_px: float = np.nan

    def with_rings(self, numbers: Indices) -> "Decoded":
        """Return this with the rings numbered anew, as a table of them says, (n,)."""
        rings = np.where(self.edges.rings >= 0, numbers[self.edges.rings], -1)
        return replace(
            self,
            cloud=replace(self.cloud, ring=numbers[self.cloud.ring].astype(np.int16)),
            edges=replace(self.edges, rings=rings),
        )

    def with_camera(self, cloud: Cloud, k: int, n_asked: int) -> "Decoded":
        """Return this with points that camera k measured by the same codes, too.

        Of so many pixels; the others count as left out, as `other_camera`.
        """
        ring = np.full(len(cloud), -2 - k, dtype=np.int16)
        lost = self.rejected.get("other_camera", 0) + n_asked - len(cloud)
        return replace(
            self,
            cloud=Cloud.join([self.cloud, replace(cloud, ring=ring)]),
            n_edges=self.n_edges + n_asked,
            rejected=self.rejected | {"other_camera": lost},
        )

    @classmethod
    def nothing(cls) -> "Decoded":
        """Return what a device that is off gives."""
        outcomes = np.zeros(0, dtype=np.int8)
        nowhere = np.zeros((0, 2))
        edges, lit = ImageEdges.nothing(), LitImage.nothing()
        return cls(Cloud.empty(), 0, 0, {}, edges, outcomes, 0, nowhere, lit)


Pairs = list[tuple[PairIndex, Decoded]]


def decode(
    frames: Frames,
    patterns: RingsForCamera,
    calibration: PairCalibration,
    *,
    min_conditioning: float = 0.1,
    max_slant: float = _MAX_SLANT,
) -> Decoded:
    """Measure points from images, pattern definitions and calibration alone.

    Left out are points of |r.m| below `min_conditioning`, and where a ring runs more
    along the viewing ray than `max_slant`, the tangent of the incidence at the camera:
    where one surface hides another, false edges hang in the step between them.

    Raises:
        ValueError: If the frames aren't as many as the patterns ask for.
    """
    if len(frames.stack) != patterns.n_frames:
        raise ValueError(
            f"{len(frames.stack)} frames, but {patterns.n_annuli - 1} rings are coded "
            f"in {patterns.n_frames}: white, black, {patterns.n_bits} bits and the "
            f"root disc, each with its inverse"
        )
    edges, lit, lit_pixels, changes = find_edges(frames, patterns)
    saturated = np.argwhere(frames.stack[0] >= SATURATED)[:, ::-1] + np.array(
        frames.corner, dtype=np.float64
    )
    # Out of order, what labels are left are chance.
    believed = not _out_of_order(*changes)
    return measure_edges(
        edges,
        patterns,
        calibration,
        lit_pixels,
        saturated,
        min_conditioning=min_conditioning,
        max_slant=max_slant,
        believed=believed,
        lit=lit if believed else None,
    )


def measure_edges(
    edges: ImageEdges,
    patterns: RingsForCamera,
    calibration: PairCalibration,
    lit_pixels: int,
    saturated: Array,
    *,
    min_conditioning: float,
    max_slant: float = _MAX_SLANT,
    believed: bool = True,
    sure_roots: bool = False,
    lit: LitImage | None = None,
) -> Decoded:
    """Measure the points of labelled edges, wherever the labels come from.

    Unless the labels can be believed, all edges are left out; with `sure_roots` those
    whose root the devices' places contradict. Saturated pixels are
    (u, v), shape (k, 2); the rest is as in `decode` and `Decoded`.
    """
    camera, projector = calibration.camera, calibration.projector
    rays = camera.rays(edges.pixels)
    radii = patterns.radii[edges.rings]
    hits = intersect_rings(camera.centre, rays, radii, edges.roots, projector)
    length, across = chains(edges, hits, camera.focal_px, max_slant)
    causes = {
        "no_intersection": ~np.isfinite(hits.distances),
        "root": _doubtful_root(edges, rays, patterns, calibration, sure_roots),
        "conditioning": ~(np.abs(hits.conditioning) >= min_conditioning),
        "outside_panel": ~projector.in_panel(projector.panel(hits.points)[0], 1.0),
        "isolated": length < _MIN_CHAIN,
        "depth_step": across > _STEPS_STEEPER * max_slant,
    }
    kept = np.ones(len(edges), dtype=bool)
    outcomes = np.full(len(edges), -1, dtype=np.int8)
    rejected: dict[str, int] = {}
    if not believed:
        causes = {"labels": kept.copy()}
    for cause, fails in causes.items():
        rejected[cause] = int(np.count_nonzero(kept & fails))
        outcomes[kept & fails] = CAUSES.index(cause)
        kept &= ~fails
    return Decoded(
        _cloud(edges, rays, hits, calibration).take(kept),
        lit_pixels,
        len(edges),
        rejected,
        edges,
        outcomes,
        len(saturated),
        saturated[:: max(1, len(saturated) // _SATURATED_KEPT)],
        lit or LitImage.nothing(),
    )


def _doubtful_root(
    edges: ImageEdges,
    rays: Array,
    patterns: RingsForCamera,
    calibration: PairCalibration,
    sure: bool,
) -> Mask:
    """Edges of which both roots, or neither, lie on the side that the disc told.

    Far from the place that the disc was drawn for, where `sure`, all but those of which
    the told one does, and it alone.
    """
    # Away from the place that the disc was drawn for, they differ near its border.
    camera, projector = calibration.camera, calibration.projector
    place = projector.to_ring(camera.centre[None])[0]
    if np.allclose(place, patterns.camera_in_ring, rtol=0.0, atol=1e-9):
        return np.zeros(len(edges), dtype=bool)

    def fits(roots: NDArray[np.int8]) -> Mask:
        radii = patterns.radii[edges.rings]
        points = intersect_rings(camera.centre, rays, radii, roots, projector).points
        local = projector.to_ring(points)
        inside = projector.in_panel(projector.panel(points)[0], 1.0)
        side = patterns.root_side(patterns.light.plane(local))
        return (np.sign(side) == edges.roots) & inside

    told, other = fits(edges.roots), fits(-edges.roots)
    return ~told | other if sure else told == other


def _out_of_order(flips: Indices, named: Indices) -> bool:
    """Whether some frame isn't the bit that it is taken for, by changes of one bit.

    Between neighbouring annuli any is a ring; with bits exchanged, those of some frames
    lead to annuli far apart, or to none.
    """
    least = max(_UNNAMED_LEAST, _UNNAMED_SHARE * int(flips.sum()))
    return bool(np.any((flips - named > least) & (named < _MIN_NAMED * flips)))


def _cloud(
    edges: ImageEdges, rays: Array, hits: RingHits, calibration: PairCalibration
) -> Cloud:
    """Points, which move on their rings with the edges: t dr - r (m.t dr)/(r.m)."""
    beside = calibration.camera.rays(edges.pixels + 0.5 * edges.across)
    moved = 2.0 * hits.distances[:, None] * (beside - rays)
    slide = np.einsum("ij,ij->i", moved, hits.normals)
    return Cloud(
        points=hits.points,
        rays=rays,
        beams=calibration.projector.aim(hits.points)[1],
        pixels=edges.pixels,
        camera=np.zeros(len(edges), dtype=np.int16),
        projector=np.zeros(len(edges), dtype=np.int16),
        ring=edges.rings.astype(np.int16),
        conditioning=hits.conditioning,
        shift=moved - (slide / hits.conditioning)[:, None] * rays,
        noise_px=edges.noise_px,
        blur_px=edges.blur_px,
        bias_px=edges.bias_px,
    )
