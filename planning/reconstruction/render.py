"""What the cameras record under a projector's patterns."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from geometry.rays import CHUNK, equal_parts

from .calibration import ProjectorCalibration
from .defocus import Defocus
from .obstacles import Occluder
from .overlap import Whites
from .patterns import Frames, Images, RingPatterns, ring_plane
from .photometry import Photometry
from .view import View

# Blurred light reaches no further than this beyond the samples that are lit [px].
_MARGIN_PX = 6
# Standard deviation of the unit square that a pixel gathers light over.
_PIXEL_SPREAD = 1.0 / np.sqrt(12.0)
# Shadow rays stop this share of their length before the point they ask about.
_SHADOW_SLACK = 2e-5


@dataclass(frozen=True, eq=False)
class _Light:
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
    def joined(cls, parts: "list[_Light]") -> "_Light":
        """Return the light on the samples of all parts."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))


@dataclass(frozen=True)
class _Blur:
    """Blur of drawn edges across the beam: in focus, and off it."""

    in_focus_m: float
    defocus: Defocus | None

    def square(self, depth: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Return the variance at depths [m^2], shape (n,)."""
        if self.defocus is None:
            return self.in_focus_m**2
        return self.in_focus_m**2 + self.defocus.blur_m(depth) ** 2


@dataclass(frozen=True, eq=False)
class _Canvas:
    """The part of a view's window that a projector lights.

    Without its light a frame and its inverse are alike, so nothing is decoded there.

    Attributes:
        corner: Pixel (u, v) of the top-left pixel.
        shape: Rows and columns, in pixels.
        fold: Cells along a pixel.
        cells: Flat index of each sample's cell, senseless outside, shape (n,).
        weights: Share of the cell that each sample stands for, shape (n,).
        inside: Samples inside.
    """

    corner: tuple[int, int]
    shape: tuple[int, int]
    fold: int
    cells: NDArray[np.int64]
    weights: NDArray[np.float32]
    inside: NDArray[np.int64]

    @classmethod
    def about(cls, seen: View, lit: NDArray[np.int64]) -> "_Canvas":
        """Return the bounding box of samples and a margin; all where there is none."""
        fold, (rows, columns) = seen.fold, seen.shape
        y, x = np.divmod(seen.cells, fold * columns)
        v, u = y // fold, x // fold
        top, left, bottom, right = 0, 0, rows, columns
        if len(lit):
            top = max(0, int(v[lit].min()) - _MARGIN_PX)
            left = max(0, int(u[lit].min()) - _MARGIN_PX)
            bottom = min(rows, int(v[lit].max()) + 1 + _MARGIN_PX)
            right = min(columns, int(u[lit].max()) + 1 + _MARGIN_PX)
        inside = (v >= top) & (v < bottom) & (u >= left) & (u < right)
        return cls(
            (seen.corner[0] + left, seen.corner[1] + top),
            (bottom - top, right - left),
            fold,
            (y - fold * top) * (fold * (right - left)) + (x - fold * left),
            seen.weights,
            np.flatnonzero(inside),
        )

    def image(
        self,
        values: NDArray[np.float32],
        samples: NDArray[np.int64],
        lens: Photometry,
    ) -> NDArray[np.float32]:
        """Return the image (h, w) that samples of these values make behind a lens."""
        rows, columns = (self.fold * side for side in self.shape)
        weighted = self.weights[samples] * values
        summed = np.bincount(self.cells[samples], weighted, rows * columns)
        cells = summed.astype(np.float32).reshape(rows, columns)
        return _binned(lens.blur(cells, self.fold), self.fold)


def _binned(cells: NDArray[np.float32], fold: int) -> NDArray[np.float32]:
    """Return the mean of the cells of each pixel."""
    if fold == 1:
        return cells
    total = np.zeros((len(cells) // fold, cells.shape[1] // fold), dtype=np.float32)
    for i in range(fold):
        for j in range(fold):
            total += cells[i::fold, j::fold]
    return total / np.float32(fold * fold)


@dataclass(frozen=True, eq=False)
class Shown:
    """A projector that shows its patterns.

    Attributes:
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh, and the bodies, that really stand there.
        defocus: Of the projector; None: equally sharp everywhere.
    """

    projector: ProjectorCalibration
    design: ProjectorCalibration
    patterns: RingPatterns
    caster: Occluder
    defocus: Defocus | None = None

    def light(self, seen: View, photometry: Photometry) -> _Light:
        """Return its light on the samples of a view."""
        blur = _Blur(photometry.projector_blur_m, self.defocus)
        devices = self.projector, self.design, self.patterns, self.caster
        return _shine(seen, *devices, blur)


def render_pair(
    seen: View,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    photometry: Photometry,
    seed: tuple[int, ...],
    defocus: Defocus | None = None,
    beside: tuple[Shown, ...] = (),
) -> Frames:
    """Return the frames of one camera under one projector.

    Args:
        seen: What the camera sees.
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh, and the bodies, that really stand there.
        photometry: Light and sensor.
        seed: Of the noise of this pair.
        defocus: Of the projector; None: equally sharp everywhere.
        beside: Other projectors that are on at the same time, in step: white with
            white, each bit and each camera's disc with its like; their light adds up.
            The exposure is that of the one projector.
    """
    one = Shown(projector, design, patterns, caster, defocus)
    light = one.light(seen, photometry)
    others = [(other.patterns, other.light(seen, photometry)) for other in beside]
    reached = [light.samples, *(other.samples for _, other in others)]
    canvas = _Canvas.about(seen, np.concatenate(reached))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    white = canvas.image(light.white, light.samples, photometry)
    brightest = float(np.percentile(white + ambient, 99.9))
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)

    levels = [_level(patterns.bit(bit), light) for bit in range(patterns.n_bits)]
    more = [
        _added(canvas, other, drawn, patterns.n_bits, photometry)
        for drawn, other in others
    ]
    white = sum((images[0] for images in more), white)
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((patterns.n_frames, *canvas.shape), dtype=kind)
    stack[0] = photometry.capture(white + ambient, (*seed, 0), gain)
    stack[1] = photometry.capture(ambient, (*seed, 1), gain)
    for index, level in enumerate([*levels, light.root]):
        bright = canvas.image(light.white * level, light.samples, photometry)
        bright = sum((images[1 + index] for images in more), bright)
        first = 2 + 2 * index
        stack[first] = photometry.capture(bright + ambient, (*seed, first), gain)
        dark = white - bright + ambient
        stack[first + 1] = photometry.capture(dark, (*seed, first + 1), gain)
    return Frames(stack, canvas.corner)


def render_whites(
    seen: View, shown: tuple[Shown, ...], photometry: Photometry, seed: tuple[int, ...]
) -> Whites:
    """Return one camera's images of several projectors' white, alone and together.

    The exposure suits each projector alone, so that what two light may saturate.

    Args:
        seen: What the camera sees.
        shown: The projectors.
        photometry: Light and sensor.
        seed: Of the noise of these images.
    """
    canvas = _Canvas.about(seen, np.zeros(0, dtype=np.int64))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    lights = [one.light(seen, photometry) for one in shown]
    whites = [canvas.image(one.white, one.samples, photometry) for one in lights]
    brightest = max(float(np.percentile(white + ambient, 99.9)) for white in whites)
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)
    images = [ambient, *(white + ambient for white in whites), sum(whites, ambient)]
    dark, *alone, together = (
        photometry.capture(image, (*seed, k), gain) for k, image in enumerate(images)
    )
    return Whites(dark, np.stack(alone), together, canvas.corner)


def _added(
    canvas: _Canvas,
    light: _Light,
    patterns: RingPatterns,
    n_bits: int,
    photometry: Photometry,
) -> list[NDArray[np.float32]]:
    """Images of a projector's white, so many bits and disc; what it lacks is dark."""
    none = np.zeros_like(light.white)
    levels = [
        _level(patterns.bit(bit), light) if bit < patterns.n_bits else none
        for bit in range(n_bits)
    ]
    values = [light.white, *(light.white * level for level in [*levels, light.root])]
    return [canvas.image(value, light.samples, photometry) for value in values]


def render_lines(
    seen: View, shown: Sequence[Shown], photometry: Photometry, seed: tuple[int, ...]
) -> Frames:
    """Return one image of bright rings, under projectors that shine at once.

    Where the light of several falls on a surface, it adds up.

    Args:
        seen: What the camera sees.
        shown: The projectors; the odd annuli of their patterns are bright.
        photometry: Light and sensor.
        seed: Of the noise.
    """
    everything = np.arange(len(seen.cells))
    canvas = _Canvas.about(seen, everything)
    around = seen.albedo * np.float32(photometry.ambient)
    image = canvas.image(around, everything, photometry)
    for one in shown:
        light = one.light(seen, photometry)
        bright = (np.arange(one.patterns.n_annuli) % 2).astype(np.float32)
        level = light.white * _level(bright, light)
        image += canvas.image(level, light.samples, photometry)
    # Lines may cover little of the image; the brightest are exposed for all the same.
    brightest = float(np.percentile(image[image > 0.0], 99.0)) if image.any() else 1.0
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)
    return Frames(photometry.capture(image, seed, gain)[None], canvas.corner)


def _level(bright: NDArray[np.float32], light: _Light) -> NDArray[np.float32]:
    """Blurred brightness of a bit's frame at each lit sample."""
    inwards = np.concatenate([bright[:1], bright[:-1]]) - bright
    outwards = np.concatenate([bright[1:], bright[-1:]]) - bright
    k = light.annulus
    level = bright[k] + inwards[k] * light.inner + outwards[k] * light.outer
    return level.astype(np.float32, copy=False)


def _shine(
    seen: View,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    blur: _Blur,
) -> _Light:
    facing = _facing(seen, projector)
    # In parts, so that what is between stays in the cache.
    parts = [
        _shine_on(seen, facing[part], projector, design, patterns, caster, blur)
        for part in equal_parts(len(facing), CHUNK) or [slice(0)]
    ]
    light = _Light.joined([light for light, _ in parts])
    if projector.light == "parallel" or not len(light.samples):
        return light
    depth = np.concatenate([depth for _, depth in parts])
    falloff = (float(np.median(depth)) / depth) ** 2
    return replace(light, white=(light.white * falloff).astype(np.float32))


def _shine_on(
    seen: View,
    facing: NDArray[np.int64],
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    blur: _Blur,
) -> tuple[_Light, NDArray[np.float64]]:
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
    light = _Light(
        lit,
        (seen.albedo[lit] * cosine * drawn).astype(np.float32),
        annulus,
        ndtr((edges[annulus] - rho) / spread).astype(np.float32),
        ndtr((rho - edges[annulus + 1]) / spread).astype(np.float32),
        ndtr(patterns.root_side(plane) / spread).astype(np.float32),
    )
    return light, depth


def _reached(
    seen: View,
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


def _facing(seen: View, projector: ProjectorCalibration) -> NDArray[np.int64]:
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
