"""One projector's light on the surface, and what it says of the gaps of its rings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.scene.codes.patterns import RingPattern
from planning.scene.lights import light_of
from planning.scene.scene import Scene

from .beam_profile import BeamProfile, cast_beam
from .ring_creases import Creases
from .ring_curvature import chord_errors, ring_curvature, smooth_stretches
from .ring_pitch import cells_at, least_gaps, projector_gaps
from .ring_spacing import GapLimits

# Cells of the ring coordinate in an even gap; a chord spans as many.
CELLS = 4
# Where nothing is lit few rings remain, for an object that stands a little aside.
_UNLIT = 4.0
# Least kappa on lit surface as a share of the largest: rings that curvature leaves over
# go to flat and creased pieces, whose ribs and pins may be narrower than a gap.
_LEAST_KAPPA = 0.01
_NO_SAMPLES = np.zeros((2, 0))


@dataclass(frozen=True, eq=False)
class RingBeam:
    """How a projector's light meets the surface.

    Attributes:
        projector: As placed, with evenly spaced rings.
        edges: Borders of the cells of the ring coordinate, shape (n + 1,).
        profile: First hits, on the rows `edges[1:]`.
        errors: Of chords over one even gap [m], shape (n, n_azimuths).
        counted: Which chords count: lit all along, no step and no crease; on the target
            alone, if any is.
        lit: Cells in which anything is lit, shape (n,).
    """

    projector: PlannedProjector
    edges: NDArray[np.float64]
    profile: BeamProfile
    errors: NDArray[np.float64]
    counted: NDArray[np.bool_]
    lit: NDArray[np.bool_]

    @classmethod
    def joined(cls, beams: Sequence["RingBeam"]) -> "RingBeam":
        """Return how the same light meets several surfaces, one at a time."""
        if len(beams) == 1:
            return beams[0]
        return cls(
            beams[0].projector,
            beams[0].edges,
            BeamProfile.joined([beam.profile for beam in beams]),
            np.concatenate([beam.errors for beam in beams], axis=1),
            np.concatenate([beam.counted for beam in beams], axis=1),
            np.any([beam.lit for beam in beams], axis=0),
        )

    @property
    def even_gap(self) -> float:
        """Gap of the evenly spaced rings, in the ring coordinate."""
        return CELLS * float(self.edges[1])

    def with_lit(self, coordinates: NDArray[np.float64]) -> "RingBeam":
        """Return this with the cells of lit samples added to what is lit."""
        lit = self.lit.copy()
        lit[cells_at(self.edges, coordinates)] = True
        return replace(self, lit=lit)

    def limits(
        self, samples: NDArray[np.float64] = _NO_SAMPLES, least_px: float = 0.0
    ) -> GapLimits:
        """Return the limits of the gaps; where nothing is lit rings are few.

        `samples` are ring coordinates of samples, and the pitch of each with even rings
        in [px], (2, n); `least_px` is the least pitch that they keep [px].
        """
        even = self.even_gap
        floor = least_gaps(samples[0], samples[1], even, least_px, self.edges)
        # A gap that holds a sample reaches up to its own length to either side of it.
        floor = _widened(floor, CELLS)
        floor = np.where(floor > 0.0, floor, even)
        drawable = projector_gaps(self.projector, self.edges[1:])
        floor = np.minimum(np.maximum(floor, drawable), even)
        lit = _widened(self.lit.astype(np.float64), CELLS) > 0.0
        kappa = ring_curvature(self.errors, self.counted, even)
        least = _LEAST_KAPPA * float(kappa.max(initial=0.0)) or 1.0
        kappa = np.where(lit, np.maximum(_widened(kappa, CELLS // 2), least), 0.0)
        return GapLimits(
            self.edges,
            kappa,
            np.where(lit, even, _UNLIT * even),
            np.where(lit, floor, _UNLIT * even),
            ~lit,
        )

    def errors_under(self, projector: PlannedProjector) -> NDArray[np.float64]:
        """Return the errors of the counted chords at a projector's own gaps, in [m]."""
        radii, rows = projector.ring_radii, np.nonzero(self.counted)[0]
        ring = np.searchsorted(radii, self.profile.coordinates[rows])
        ring = np.clip(ring, 1, len(radii) - 1)
        gaps = radii[ring] - radii[ring - 1]
        return self.errors[self.counted] * (gaps / self.even_gap) ** 2


def ring_beam(scene: Scene, projector: PlannedProjector, creases: Creases) -> RingBeam:
    """Cast the light of a projector with evenly spaced rings."""
    scene.check_cancelled()
    radii = projector.ring_radii
    edges = np.linspace(0.0, float(radii[-1]), CELLS * len(radii) + 1)
    profile = cast_beam(scene, projector, edges[1:])
    reach, limit = CELLS // 2, scene.requirements.projector.max_incidence
    smooth = smooth_stretches(projector, profile, reach, limit)
    smooth &= ~_creased(projector, edges, creases, profile.lit.shape)
    on_target = smooth & profile.target
    return RingBeam(
        projector,
        edges,
        profile,
        chord_errors(
            profile.heights, profile.coordinates, reach, light_of(projector.device)
        ),
        on_target if on_target.any() else smooth,
        np.asarray(profile.lit.any(axis=1)),
    )


def _creased(
    projector: PlannedProjector,
    edges: NDArray[np.float64],
    creases: Creases,
    shape: tuple[int, ...],
) -> NDArray[np.bool_]:
    """Cells of the grid whose chord may cross a crease."""
    masked = np.zeros(shape, dtype=bool)
    n_azimuths = shape[1]
    ring = creases.points - projector.world_from_ring[:3, 3]
    ring = ring @ projector.world_from_ring[:3, :3]
    degree = 2.0 * np.pi / n_azimuths
    turn = np.arctan2(ring[:, 1], ring[:, 0]) % (2.0 * np.pi)
    column = np.floor(turn / degree).astype(np.int64)
    row = np.searchsorted(edges, RingPattern(projector).coordinate(creases.points)) - 1
    # Near the axis a short piece of crease is seen under a wide angle.
    half = 0.5 * creases.length
    angle = np.arctan2(half, np.hypot(ring[:, 0], ring[:, 1]))
    width = 1 + np.floor(angle / degree).astype(np.int64)
    most = int(width.max(initial=0))
    reach = CELLS // 2 + 1
    for down in range(-reach, reach + 1):
        inside = (row + down >= 0) & (row + down < len(masked))
        for aside in range(-most, most + 1):
            near = inside & (width >= abs(aside))
            masked[row[near] + down, (column[near] + aside) % n_azimuths] = True
    return masked


def _widened(values: NDArray[np.float64], cells: int) -> NDArray[np.float64]:
    """Return the largest value within so many cells to either side."""
    padded = np.pad(values, cells, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * cells + 1)
    return windows.max(axis=1)
