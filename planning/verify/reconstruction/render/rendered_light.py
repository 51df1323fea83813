"""A projector's light on what a camera sees: which annulus, how bright, how blurred."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from geometry.rays.rays import CHUNK, equal_parts
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.patterns.ring_patterns import (
    RingPatterns,
    ring_plane,
)

from .defocus import Defocus
from .occluders import Occluder
from .view import RenderedView

# Standard deviation of the unit square that a pixel gathers light over.
_PIXEL_SPREAD = 1.0 / np.sqrt(12.0)
# Shadow rays stop this share of their length before the point they ask about.
_SHADOW_SLACK = 2e-5


@dataclass(frozen=True, eq=False)
class RenderedLight:
    """A projector's light on the samples of a view that it reaches, shape (n,) each.

    `annulus` is where a sample lies; `inner` and `outer` the shares of blurred light
    from the next annulus inwards and outwards; `root` the share of the root disc's
    outside; `white` the irradiance under the white frame times the albedo.
    """

    samples: NDArray[np.int64]
    white: NDArray[np.float32]
    annulus: NDArray[np.int64]
    inner: NDArray[np.float32]
    outer: NDArray[np.float32]
    root: NDArray[np.float32]

    @classmethod
    def joined(cls, parts: "list[RenderedLight]") -> "RenderedLight":
        """Return the light on the samples of all parts."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))


@dataclass(frozen=True)
class Blur:
    """Blur of drawn edges across the beam: in focus, and off it."""

    in_focus_m: float
    defocus: Defocus | None

    def square(self, depth: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Return the variance at depths [m^2], shape (n,)."""
        if self.defocus is None:
            return self.in_focus_m**2
        return self.in_focus_m**2 + self.defocus.blur_m(depth) ** 2


def shine(
    seen: RenderedView,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    blur: Blur,
) -> RenderedLight:
    """Return a projector's light on the samples of a view.

    Args:
        seen: What the camera sees.
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh, and the bodies, that really stand there.
        blur: Of drawn edges.
    """
    facing = _facing(seen, projector)
    # In parts, so that what is between stays in the cache.
    parts = [
        _shine_on(seen, facing[part], projector, design, patterns, caster, blur)
        for part in equal_parts(len(facing), CHUNK) or [slice(0)]
    ]
    light = RenderedLight.joined([light for light, _ in parts])
    if projector.light == "parallel" or not len(light.samples):
        return light
    depth = np.concatenate([depth for _, depth in parts])
    falloff = (float(np.median(depth)) / depth) ** 2
    return replace(light, white=(light.white * falloff).astype(np.float32))


def _shine_on(
    seen: RenderedView,
    facing: NDArray[np.int64],
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    blur: Blur,
) -> tuple[RenderedLight, NDArray[np.float64]]:
    """Light on those of some samples that it reaches, and their depths.

    How it falls off with depth is left to the caller.
    """
    lit, cosine, pixels, depth = _reached(seen, facing, projector, caster)
    rays, normals = seen.rays[lit], seen.normals[lit]
    plane = ring_plane(design, pixels)
    rho = np.hypot(plane[:, 0], plane[:, 1])
    # Ring coordinate in a metre across the beam.
    scale = np.ones_like(rho)
    if projector.light == "diverging":
        scale = np.sqrt(1.0 + rho * rho) / depth
    across = _across(plane, rho, design)
    slant = np.einsum("ij,ij->i", across, rays) / np.einsum("ij,ij->i", normals, rays)
    stretch = 1.0 - 2.0 * slant * np.einsum("ij,ij->i", across, normals) + slant**2
    cell = _PIXEL_SPREAD / seen.fold
    pixel = cell * seen.distances[lit] / seen.camera.focal_px
    spread = scale * np.sqrt(blur.square(depth) + pixel**2 * np.maximum(stretch, 0.0))
    annulus = np.searchsorted(patterns.radii, rho)
    edges = np.concatenate([[-np.inf], patterns.radii, [np.inf]])
    drawn = ndtr((patterns.outer_radius - rho) / spread)
    light = RenderedLight(
        lit,
        (seen.albedo[lit] * cosine * drawn).astype(np.float32),
        annulus,
        ndtr((edges[annulus] - rho) / spread).astype(np.float32),
        ndtr((rho - edges[annulus + 1]) / spread).astype(np.float32),
        ndtr(patterns.root_side(plane) / spread).astype(np.float32),
    )
    return light, depth


def _reached(
    seen: RenderedView,
    facing: NDArray[np.int64],
    projector: ProjectorCalibration,
    caster: Occluder,
) -> tuple[
    NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:
    """Samples that the projector lights, their cos(incidence), pixels and depths."""
    pixels, depth = projector.panel(seen.points[facing])
    drawn = projector.in_panel(pixels)
    able, pixels, depth = facing[drawn], pixels[drawn], depth[drawn]
    points = seen.points[able]
    if projector.light == "diverging":
        starts = projector.centre
        beams = points - starts
        reach = np.sqrt(np.einsum("ij,ij->i", beams, beams))
        beams /= reach[:, None]
    else:
        beams, reach = np.broadcast_to(projector.axis, points.shape), depth
        starts = points - reach[:, None] * beams
    shadowed = caster.occluded(starts, beams, reach * (1.0 - _SHADOW_SLACK))
    cosine = -np.einsum("ij,ij->i", beams, seen.normals[able])
    lit = ~shadowed
    return able[lit], cosine[lit], pixels[lit], depth[lit]


def _facing(seen: RenderedView, projector: ProjectorCalibration) -> NDArray[np.int64]:
    """Samples whose faces are turned towards the projector."""
    along = seen.normals @ projector.axis
    if projector.light == "diverging":
        along = np.einsum("ij,ij->i", seen.normals, seen.points)
        along -= seen.normals @ projector.centre
    return np.flatnonzero(along < 0.0)


def _across(
    plane: NDArray[np.float64], rho: NDArray[np.float64], design: ProjectorCalibration
) -> NDArray[np.float64]:
    """Unit normals of the ring surfaces in the world, (n, 3)."""
    tilt = rho if design.light == "diverging" else np.zeros_like(rho)
    flat = plane / np.maximum(rho, 1e-12)[:, None]
    local = np.column_stack([flat, -tilt]) / np.sqrt(1.0 + tilt * tilt)[:, None]
    return local @ design.world_from_ring[:3, :3].T
