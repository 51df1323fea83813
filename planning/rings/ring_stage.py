"""Section 4 of the formulation: the rings of each projector, once cameras are known.

Rings are as dense as sqrt(kappa) asks, never wider apart than the planner's even
spacing where light was found, and never finer than the cameras and the projector
separate. So what is measured stays measured. Light is found by rays on a grid, by
samples, and by those for which the number of cameras was proved with evenly spaced
rings: of a pair's limits only the pitch knows the gap, and a finer gap passes nothing
that a wider one didn't, so fewer cameras are too few for the final rings, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.device_poses import DECIMALS
from planning.model.devices.planned import PlannedCamera, PlannedProjector, code_bits
from planning.model.document.ring_records import CreasesRecord, RingsRecord
from planning.model.requirements import Requirements
from planning.scene.codes.patterns import RingPattern
from planning.scene.draws import DRAWS
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.measuring.camera_views import view_of
from planning.scene.measuring.measured import LitSamples, lit_samples
from planning.scene.samples import merged
from planning.scene.scene import Scene

from .idle_rings import idle_rings
from .ring_creases import Creases, crease_errors, find_creases
from .ring_limits import RingBeam, ring_beam
from .ring_pitch import best_pitch, users
from .ring_radii import least_pitch_px, uniform_radii
from .ring_spacing import GapLimits, spaced_radii

Spacing = Literal["uniform", "curvature"]

_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class RingStage:
    """Projectors with their final rings, and `rings` of the plan.

    Attributes:
        projectors: Without the rings that would light nothing.
        even: With evenly spaced rings.
        spaced: With all that were spaced, idle or not.
        kept_even: Places of those that keep even rings, since samples would be lost.
        records: What the plan says of each; none of a family, whose members say it.
    """

    projectors: tuple[PlannedProjector, ...]
    even: tuple[PlannedProjector, ...]
    spaced: tuple[PlannedProjector, ...]
    kept_even: frozenset[int] = frozenset()
    records: tuple[RingsRecord, ...] = ()

    def on(self, scene: Scene) -> "RingStage":
        """Return the same rings, with what is to be said of them on one surface."""
        creases = _creases(scene)
        records: list[RingsRecord] = []
        for p, spaced in enumerate(self.spaced):
            record = rings_record(
                scene,
                ring_beam(scene, _evenly(self.even[p]), creases),
                spaced,
                creases,
                kept_even=p in self.kept_even,
            )
            records.append(self.without_idle(p, record))
        return replace(self, records=tuple(records))

    def without_idle(self, p: int, record: RingsRecord) -> RingsRecord:
        """Return what is said of a projector's rings, with those left out."""
        left = np.setdiff1d(self.spaced[p].ring_radii, self.projectors[p].ring_radii)
        if not left.size:
            return record
        return record.changed(left_out=tuple(np.round(left, DECIMALS).tolist()))


@dataclass(frozen=True, eq=False)
class _Draw:
    """Lit samples of target and surface, how cameras see them, and their best pitch."""

    samples: LitSamples
    views: tuple[ViewedSamples, ...]
    pitch: NDArray[np.float64]


def space_rings(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    spacing: Spacing,
    proved: LitSamples | None = None,
    *,
    margin: float = np.inf,
) -> RingStage:
    """Return the projectors with rings spaced for the surface and the cameras.

    A projector keeps its even rings where others would lose a measured sample. Those
    that keep their rings are reported on. Rings that would light nothing, though the
    object stood a margin aside, in the unit of radii, are left out.

    Where `spacing` is `uniform` rings stay, and are reported on. Fewer cameras were
    proved too few for the samples `proved`.
    """
    even = tuple(projectors)
    steady = tuple(_evenly(projector) for projector in even)
    surfaces = [(surface, _creases(surface)) for surface in scene.surfaces]
    beams = tuple(
        RingBeam.joined([ring_beam(one, projector, sharp) for one, sharp in surfaces])
        for projector in steady
    )
    if proved is not None:
        beams = tuple(b.with_lit(_lit_at(b, proved, p)) for p, b in enumerate(beams))
    final, losing = even, frozenset[int]()
    if spacing == "curvature":
        final, losing = _spaced(scene, even, cameras, beams)
    shown = list(final)
    for p, beam in enumerate(beams):
        idle = idle_rings(scene, final[p], beam.profile, margin)
        if idle.any():
            shown[p] = replace(final[p], ring_radii=final[p].ring_radii[~idle])
    kept = frozenset(p for p in losing if not even[p].keeps_rings)
    stage = RingStage(tuple(shown), even, final, kept)
    if len(surfaces) > 1:
        return stage
    ((_, creases),) = surfaces
    records = (
        rings_record(scene, beam, final[p], creases, kept_even=p in kept)
        for p, beam in enumerate(beams)
    )
    return replace(
        stage,
        records=tuple(
            stage.without_idle(p, record) for p, record in enumerate(records)
        ),
    )


def _creases(scene: Scene) -> Creases:
    return find_creases(scene.mesh, 0.5 * scene.mesh.mean_edge)


def tolerance_m(requirements: Requirements) -> float:
    """Return e_tol, the largest error between rings that is accepted, in [m].

    The accuracy that was asked for along the normal (`max_sigma_m`), else the check's
    95th percentile.
    """
    asked = requirements.triangulation.max_sigma_m
    return requirements.check.max_p95_m if asked is None else asked


def _spaced(
    scene: Scene,
    even: tuple[PlannedProjector, ...],
    cameras: Sequence[PlannedCamera],
    beams: tuple[RingBeam, ...],
) -> tuple[tuple[PlannedProjector, ...], frozenset[int]]:
    """Space rings; samples of a fresh draw that this loses join those that bind.

    Returns:
        The projectors; those that keep even rings, since samples were lost to the last.
    """
    every, tolerance = range(len(even)), tolerance_m(scene.requirements)
    least_px = least_pitch_px(scene.requirements.triangulation)
    draw = _draw(scene, even, cameras, 0)
    binding = _binding(scene, even, draw, np.ones(len(draw.samples.target), dtype=bool))
    lost = np.zeros(0, dtype=bool)
    final = even
    for attempt in range(1, _ROUNDS + 1):
        beams = tuple(
            beam.with_lit(_lit_at(beam, draw.samples, p))
            for p, beam in enumerate(beams)
        )
        limits = [beams[p].limits(binding[p], least_px) for p in every]
        pairs = zip(even, limits, strict=True)
        final = tuple(_spaced_for(p, bound, tolerance) for p, bound in pairs)
        draw = _draw(scene, even, cameras, attempt)
        lost = _lost(scene, draw, final)
        if not lost.any():
            break
        more = _binding(scene, even, draw, lost)
        binding = [np.hstack([binding[p], more[p]]) for p in every]
    kept: set[int] = set()
    while lost.any():
        kept |= set(np.flatnonzero((draw.pitch[lost] > 0).any(axis=0)).tolist())
        final = tuple(even[p] if p in kept else final[p] for p in every)
        lost = _lost(scene, draw, final)
    return final, frozenset(p for p in kept if not even[p].keeps_rings)


def _spaced_for(
    projector: PlannedProjector, limits: GapLimits, tolerance_m: float
) -> PlannedProjector:
    """A projector with the rings that limits let it have, unless its own stay."""
    if projector.keeps_rings:
        return projector
    # As many as the frames of the even rings tell apart: more of them are free.
    most = (1 << code_bits(len(projector.ring_radii))) - 1
    radii = spaced_radii(limits, most, tolerance_m)
    return replace(projector, ring_radii=radii)


def _evenly(projector: PlannedProjector) -> PlannedProjector:
    """A projector whose rings stay, with as many at equal steps; others as they are."""
    if not projector.keeps_rings:
        return projector
    outer, n = float(projector.ring_radii[-1]), len(projector.ring_radii)
    return replace(projector, ring_radii=uniform_radii(outer, outer / n))


def _draw(
    scene: Scene,
    even: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    number: int,
) -> _Draw:
    """Samples of the target and of the surface: what is claimed of either counts."""
    fresh = DRAWS.rings.later(2 * number)
    both = merged(
        scene.target_samples(fresh),
        scene.surface_samples(fresh),
    )
    samples = lit_samples(scene, even, both)
    views = tuple(view_of(scene, c, samples.target) for c in cameras)
    return _Draw(samples, views, best_pitch(scene, even, views, samples))


def _binding(
    scene: Scene,
    even: Sequence[PlannedProjector],
    draw: _Draw,
    chosen: NDArray[np.bool_],
) -> list[NDArray[np.float64]]:
    """Ring coordinates and pitches of chosen samples, by their user, (2, n) each."""
    user = np.where(chosen, users(scene, even, draw.samples, draw.pitch), -1)
    points = draw.samples.target.samples.points
    return [
        np.stack(
            [
                RingPattern(projector).coordinate(points[user == p]),
                draw.pitch[user == p, p],
            ]
        )
        for p, projector in enumerate(even)
    ]


def _lit_at(beam: RingBeam, samples: LitSamples, p: int) -> NDArray[np.float64]:
    return RingPattern(beam.projector).coordinate(
        samples.target.samples.points[samples.lit[:, p]]
    )


def _lost(
    scene: Scene, draw: _Draw, projectors: Sequence[PlannedProjector]
) -> NDArray[np.bool_]:
    """Samples that even rings measure and these don't, shape (n,)."""
    after = best_pitch(scene, projectors, draw.views, draw.samples)
    return np.asarray((draw.pitch > 0).any(axis=1) & ~(after > 0).any(axis=1))


def rings_record(
    scene: Scene,
    beam: RingBeam,
    final: PlannedProjector,
    creases: Creases,
    *,
    kept_even: bool,
) -> RingsRecord:
    """Return what a plan says of a projector's rings."""
    lit, error = crease_errors(scene, final, creases)
    # Rounding decides whether the last row lies inside the last ring.
    shone = beam.profile.points[:-1][beam.profile.lit[:-1]]
    gaps = RingPattern(final).surfaces(shone).spacing
    errors = beam.errors_under(final) > tolerance_m(scene.requirements)
    spaced = "uniform" if final is beam.projector else "curvature"
    return RingsRecord(
        spacing="kept" if final.keeps_rings else spaced,
        kept_even=kept_even,
        n_even=len(beam.projector.ring_radii),
        gap_m=(float(gaps.min()), float(gaps.max())) if len(gaps) else None,
        over_tolerance=float(errors.mean()) if len(errors) else 0.0,
        creases=CreasesRecord(
            length_m=float(creases.length[lit].sum()),
            max_error_m=float(error[lit].max(initial=0.0)),
        ),
    )
