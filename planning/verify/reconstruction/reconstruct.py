"""The simulated reconstruction: render, decode, triangulate, merge, compare."""

from dataclasses import dataclass, replace
from functools import partial

from geometry.parallel import n_threads
from planning.verify.reconstruction.check.accuracy import Completeness, Expected
from planning.verify.reconstruction.check.judged import fresh_samples, judged
from planning.verify.reconstruction.check.merge import Merged, merge
from planning.verify.reconstruction.check.overlaps import ring_pitch_px
from planning.verify.reconstruction.check.result import PairCount, Reconstruction
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.decode.dense.camera_pairs import between_cameras
from planning.verify.reconstruction.density.second_sequence import (
    both_sequences,
    numbered,
    second_sequence,
)
from planning.verify.reconstruction.faults.causes import explained
from planning.verify.reconstruction.faults.measured_clouds import (
    MeasuredClouds,
    rejection,
)
from planning.verify.reconstruction.render.mitsuba.decoded import decode_path_traced
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.photometry import Photometry, assumed_light
from planning.verify.reconstruction.render.rendered import (
    Progress,
    Spent,
    decode_rendered,
)

from .cloud import Cloud
from .scanner import Scanner


def reconstruct(
    plan: Scanner,
    *,
    seed: int,
    threads: int | None = None,
    truth: Scanner | None = None,
    expected: Expected | None = None,
    photometry: Photometry | None = None,
    physics: Physics | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Measure an object through rendered images, and judge the result.

    Args:
        plan: What the decoder believes: poses, optics, patterns; its mesh is compared.
        seed: Of the pixel noise; every frame draws from a stream of its own.
        threads: Worker threads; no result depends on them. None: all cores.
        truth: What really stands there, devices matched by id; the plan by default. A
            device that it lacks is off.
        expected: Points of the surface to judge completeness on, and which of them the
            plan claims measured; those outside the target are left aside. By default
            fresh points of the target, whose completeness is reported but not judged.
        photometry: Simulated light and sensor; None: as the plan's check assumes.
        physics: What Mitsuba renders; None: the built-in renderer does.
        progress: Called with the pairs done and their total.

    Raises:
        InputError: If Mitsuba is asked for and isn't installed, or lacks a lens.
    """
    threads = threads or n_threads()
    light, spent = photometry or assumed_light(plan), Spent()
    draw = decode_rendered
    if physics is not None:
        draw = partial(decode_path_traced, physics=physics)
    decoded = draw(
        plan,
        truth or plan,
        light,
        seed=seed,
        threads=threads,
        progress=progress,
        spent=spent,
    )
    return conclude(
        plan, decoded, seed=seed, expected=expected, photometry=light, spent=spent
    )


@dataclass(frozen=True, eq=False)
class BothSequences:
    """What a first sequence gave, the rig of a second one, and what both give."""

    first: Reconstruction
    second: Scanner
    both: Reconstruction


def reconstruct_twice(
    plan: Scanner,
    *,
    seed: int,
    threads: int | None = None,
    mounted: Scanner | None = None,
    expected: Expected | None = None,
    photometry: Photometry | None = None,
    progress: Progress | None = None,
) -> BothSequences:
    """Measure an object with the plan's rings, and once more with rings between them.

    Where these lie follows from the first points (`second_sequence`). Arguments are as
    of `reconstruct`; `mounted` is how the devices stand, as the decoder knows, too. The
    second sequence's noise is another.

    Raises:
        InputError: If the pattern is dense.
    """
    plan.require_rings("a second sequence")
    threads = threads or n_threads()
    light, stands = photometry or assumed_light(plan), mounted or plan
    if expected is None:
        expected = fresh_samples(plan, seed)

    def measure(design: Scanner, turn: int) -> tuple[Pairs, Reconstruction]:
        spent, rig = Spent(), _ringed(stands, design)
        decoded = decode_rendered(
            design,
            stands,
            light,
            seed=seed + turn,
            threads=threads,
            progress=progress,
            spent=spent,
            believed=rig,
        )
        return decoded, conclude(
            rig,
            decoded,
            seed=seed,
            expected=expected,
            photometry=light,
            spent=spent,
        )

    decoded, first = measure(plan, 0)
    second = second_sequence(stands, first.everything)
    more, again = measure(second, 1)
    rig, (before, after) = both_sequences(stands, second)
    pairs = [
        (pair, one.with_rings(places[pair[0]]))
        for sequence, places in ((decoded, before), (more, after))
        for pair, one in sequence
    ]
    # Each without its redundancy: rings of different places don't repeat each other.
    merged = replace(
        first.merged.joined(again.merged),
        cloud=Cloud.join(
            [numbered(first.merged.cloud, before), numbered(again.merged.cloud, after)]
        ),
    )
    both = _judged(rig, pairs, merged, expected, light, Spent())
    return BothSequences(first, second, both)


def _ringed(stands: Scanner, design: Scanner) -> Scanner:
    """Return devices as they stand, with the rings of a design."""
    pairs = zip(stands.projectors, design.projectors, strict=True)
    shown = tuple(replace(a, pattern=b.pattern) for a, b in pairs)
    return replace(stands, projectors=shown)


def conclude(
    plan: Scanner,
    decoded: Pairs,
    *,
    seed: int,
    expected: Expected | None = None,
    photometry: Photometry | None = None,
    spent: Spent | None = None,
) -> Reconstruction:
    """Merge what the pairs of a rig measured, and judge it, as `reconstruct` does.

    Without photometry the images were taken. The time of merging is added to `spent`.
    """
    expected = expected or fresh_samples(plan, seed)
    spent = spent or Spent()
    with spent.on("decode"):
        decoded = with_camera_pairs(plan, decoded)
    everything = _everything(decoded)
    with spent.on("merge"):
        lit = {pair: gave.lit for pair, gave in decoded}
        merged = merge(everything, plan, lit, pitch_px=ring_pitch_px(everything, plan))
    return _judged(plan, decoded, merged, expected, photometry, spent)


def _everything(decoded: Pairs) -> Cloud:
    return Cloud.join([pair.cloud.of_devices(p, c) for (p, c), pair in decoded])


def with_camera_pairs(plan: Scanner, decoded: Pairs) -> Pairs:
    """Return what pairs measured, with what two cameras of a projector did.

    Points of two cameras are added to those of the first of them.
    """
    if not plan.is_dense:
        return decoded
    codes = {pair: gave.codes for pair, gave in decoded if gave.codes is not None}
    every: Pairs = []
    for (p, c), gave in decoded:
        for k in range(c + 1, len(plan.cameras)):
            if (p, c) in codes and (p, k) in codes:
                one, other = ((plan.cameras[i], codes[p, i]) for i in (c, k))
                cloud, n_asked = between_cameras(one, other, plan.limits.dense)
                gave = gave.with_camera(cloud, k, n_asked)
        every.append(((p, c), gave))
    return every


def _judged(
    plan: Scanner,
    decoded: Pairs,
    merged: Merged,
    expected: Expected,
    photometry: Photometry | None,
    spent: Spent,
) -> Reconstruction:
    """Hold what was merged against the object and the limits, and seek causes."""
    everything = _everything(decoded)
    pairs = tuple(PairCount.of(plan, pair, gave) for pair, gave in decoded)

    def causes(failures: tuple[str, ...], found: Completeness) -> tuple[str, ...]:
        within = expected.within(plan.target)
        measured = MeasuredClouds(
            plan, decoded, pairs, everything, within, found.missing
        )
        return explained(failures, measured)

    return judged(
        *(plan, everything, merged, pairs, expected),
        photometry=photometry,
        spent=spent,
        nothing=f"no point was measured: {rejection(pairs) or 'nothing was decoded'}",
        explain=causes,
    )
