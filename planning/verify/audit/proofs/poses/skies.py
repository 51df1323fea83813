"""Maps of the directions in which a device can't serve a sample, and how far they last.

The sky of a sample is drawn flat about its normal N: a direction at an angle t from N
lies t away from the middle, on its own side. On that map directions are no nearer than
on the sphere, and within the cap of t <= T < pi/2, which holds all that matters, at
most T / sin T times as far. So a cell that is seen within psi of u lies on the map
within psi T / sin T of u, or of the point of the cap that is nearest to u.

A pixel is closed if all of it is: outside of the cap, too nearly along T1, or blocked.
Pixels that no outline comes near fall into pieces, and of a piece all directions are
blocked or none is: one ray decides. The same is asked of faces near the sample alone,
since outlines that these hide open nothing. Of each pixel the map holds how far the
nearest is that isn't closed; cells within that are closed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from geometry.arrays import Array, Ints, Mask, cross
from geometry.parallel import mapped
from geometry.rays.rays import RayCaster
from planning.verify.audit.audit_samples import AuditSamples

from .outlines import Outlines
from .sphere_cells import Cells

# Pixels beyond the rim of the cap.
_BEYOND = 4
# Half a pixel's diagonal, and how far apart directions along an outline are drawn [px].
_HALF, _STEP = 0.5**0.5, 0.9
# Shares of the size of the mesh: of faces within these, outlines are drawn alone too.
_NEAR = (0.04, 0.16)
_FARTHEST = 255
# Samples after whose maps a word is said.
_TOLD = 256


@dataclass(frozen=True, eq=False)
class Skies:
    """The maps of samples.

    Attributes:
        cap: T, the largest incidence [rad].
        frames: Two directions across N, and N, of each sample, (n, 3, 3).
        radii: Pixels to the nearest that isn't closed, rounded down, (n, s, s).
        pixels: From the middle of a map to the rim of the cap.
    """

    cap: float
    frames: Array
    radii: NDArray[np.uint8]
    pixels: int

    def leave_open(
        self, served: Mask, cells: Cells, psi: Array, points: Array | None
    ) -> None:
        """Strike what no place of a cell can serve, of (cells, samples), in place."""
        at, k = np.nonzero(served)
        closed = self.closed(k, cells.towards(points, at, k), psi[at, k])
        served[at[closed], k[closed]] = False

    def closed(self, samples: Ints, towards: Array, psi: Array) -> Mask:
        """Return which samples no place of a cell can serve, each with its cell.

        Cells are seen within psi (k,) of unit directions (k, 3).
        """
        reach = psi / np.sin(self.cap) * self.pixels + 2.0 * _HALF
        return self._radius(samples, towards) > reach

    def shut(self, samples: Ints, towards: Array) -> Mask:
        """Return whether pixels are closed in which directions (k, 3) lie."""
        return self._radius(samples, towards) > 0

    def _radius(self, samples: Ints, towards: Array) -> NDArray[np.uint8]:
        local = np.einsum("kij,kj->ki", self.frames[samples], towards)
        flat = _flat(local, self.cap, self.pixels, clamped=True)
        at = _places(flat, self.pixels)
        return self.radii[samples, at[:, 0], at[:, 1]]


class SkyMaps:
    """Draws the maps of samples, each once.

    Args:
        samples: Of the caster's mesh.
        caster: Of the mesh that blocks.
        cap: Largest incidence, below a right angle [rad].
        tangent: Least angle to the line of T1 [rad].
        touching_m: Faces that come nearer to a sample block nothing of it.
        pixels: From the middle of a map to the rim of the cap.
    """

    def __init__(
        self,
        samples: AuditSamples,
        caster: RayCaster,
        cap: float,
        tangent: float,
        touching_m: float,
        pixels: int,
    ) -> None:
        self._samples, self._caster, self._cap = samples, caster, cap
        self._tangent, self._touching_m = tangent, touching_m
        self._pixels = pixels
        self._outlines = Outlines(caster.mesh)
        frames = [_frame(normal) for normal in samples.normals]
        self._frames = np.array(frames).reshape(-1, 3, 3)
        self._done = np.zeros(len(samples), dtype=bool)
        side = 2 * (pixels + _BEYOND) + 1
        self._radii = np.zeros((len(samples), side, side), dtype=np.uint8)
        offsets = (np.indices((side, side)) - (pixels + _BEYOND)).reshape(2, -1).T
        self._pixel = pixel = cap / pixels
        self._off = off = pixel * np.linalg.norm(offsets, axis=1)
        share = np.sinc(off / np.pi)[:, None] * pixel
        self._local = np.column_stack([share * offsets, np.cos(off)])

    def of(self, some: Ints, say: Callable[[str], None]) -> Skies:
        """Return the maps of some of the samples, by their numbers."""
        missing = some[~self._done[some]]
        parts = range(0, len(missing), _TOLD)
        for begin in parts:
            part = missing[begin : begin + _TOLD].tolist()
            mapped(self._draw, part, self._caster.threads)
            say(f"shadows of {begin + len(part)} of {len(missing)} samples")
        self._done[some] = True
        return Skies(self._cap, self._frames[some], self._radii[some], self._pixels)

    def _draw(self, k: int) -> None:
        pixel, samples = self._pixel, self._samples
        closed = self._off > self._cap + _HALF * pixel
        along = np.abs(self._local @ (self._frames[k] @ samples.steep[k]))
        closed |= along > np.cos(max(0.0, self._tangent - _HALF * pixel))
        side = self._radii.shape[1:]
        drawn = (self._off <= self._cap + 1.5 * pixel).reshape(side)
        sky = _Sky(
            self._outlines,
            self._caster,
            samples.points[k],
            self._touching_m,
            self._pixels,
        )
        closed |= sky.blocked(self._frames[k], self._local, drawn, self._cap)
        far: Array = np.asarray(distance_transform_edt(closed.reshape(side)))
        self._radii[k] = np.minimum(np.floor(far), _FARTHEST)


@dataclass(frozen=True, eq=False)
class _Sky:
    """What a mesh blocks of one sample."""

    outlines: Outlines
    caster: RayCaster
    point: Array
    touching_m: float
    pixels: int

    def blocked(self, frame: Array, local: Array, drawn: Mask, cap: float) -> Mask:
        """Return which pixels are blocked for sure; those of `drawn` are looked at."""
        sides = self.outlines.sides(self.point)
        # Its own face is among those that touch it.
        others = np.ones(len(sides), dtype=bool)
        others[self.outlines.touching(self.point, sides, self.touching_m)] = False
        mesh = self.caster.mesh
        away = np.linalg.norm(mesh.vertices - self.point, axis=1)
        a, b, c = mesh.faces.T
        away = np.maximum(np.maximum(away[a], away[b]), away[c])
        blocked = np.zeros(drawn.size, dtype=bool)
        for share in (*_NEAR, np.inf):
            some = others & (away <= share * self.outlines.size)
            if not some.any():
                continue
            pieces, count = self._pieces(frame, drawn, cap, sides, some)
            place = np.full(count + 1, -1)
            within = np.flatnonzero(pieces)
            place[pieces[within]] = within
            rays = local[place[1:]] @ frame
            hit, _ = self.caster.first_hits(self.point + self.touching_m * rays, rays)
            shut = np.concatenate([[False], (hit >= 0) & some[hit]])
            blocked |= shut[pieces]
        return blocked

    def _pieces(
        self, frame: Array, drawn: Mask, cap: float, sides: Array, some: Mask
    ) -> tuple[Ints, int]:
        """Number the pieces of pixels that no outline comes near, from 1; 0: others."""
        pixel = cap / self.pixels
        rim = cap + 3.0 * pixel
        step = _STEP * pixel * np.sin(rim) / rim
        edges = self.outlines.of_faces(sides, some)
        edges = edges[self.outlines.above(self.point, frame[2], edges)]
        sky = self.outlines.arcs(self.point, edges, step) @ frame.T
        sky = sky[sky[:, 2] >= np.cos(rim)]
        at = _places(_flat(sky, cap, self.pixels), self.pixels)
        touched = np.zeros(drawn.shape, dtype=bool)
        touched[at[:, 0], at[:, 1]] = True
        # A direction between two that were drawn is at most a pixel aside.
        for axis in (0, 1):
            touched |= np.roll(touched, 1, axis) | np.roll(touched, -1, axis)
        free = drawn & ~touched
        pieces = np.zeros(drawn.shape, dtype=np.int32)
        label(free, output=pieces)
        return pieces.ravel().astype(np.int64), int(pieces.max())


def _flat(local: Array, cap: float, pixels: int, *, clamped: bool = False) -> Array:
    """Return where directions (n, 3) lie about the middle of the map, (n, 2) [px]."""
    across = np.hypot(local[:, 0], local[:, 1])
    off = np.arctan2(across, local[:, 2])
    if clamped:
        off = np.minimum(off, cap)
    scale = off * pixels / cap / np.where(across > 0.0, across, 1.0)
    return scale[:, None] * local[:, :2]


def _places(flat: Array, pixels: int) -> Ints:
    return np.rint(flat).astype(np.int64) + pixels + _BEYOND


def _frame(normal: Array) -> Array:
    spare = np.eye(3)[np.argmin(np.abs(normal))]
    across = cross(normal, spare)
    across /= np.linalg.norm(across)
    return np.stack([across, cross(normal, across), normal])
