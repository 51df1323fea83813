"""What the errors of a reconstruction point at, in words."""

from dataclasses import dataclass

from planning.verify.reconstruction.arrays import Mask
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import PairCount
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

from .cause_words import in_words
from .diagnosis import diagnose
from .inaccurate import where_inaccurate, wrong_roots
from .missing import hole_between, left_out_nearby, lit_twice, missing_where, no_edges

# A device whose edges are fewer than this share of what its role gives is all but dark.
_DARK_SHARE = 0.01
# More saturated pixels than this share of the lit ones are no highlights.
_SATURATED_SHARE = 0.02


_WORDS = {
    "labels": "the codes contradict the patterns: frames out of order or of another "
    "projector, or two projectors on at once",
    "unconfirmed": "neither the mesh nor another pair confirms the points",
    "off_prior": "no ring meets the rays near the prior mesh",
    "ambiguous": "several rings meet the rays near the prior mesh: fewer rings or a "
    "better prior would tell them apart",
    "no_intersection": "the rays miss the rings: a pose isn't that of the plan",
    "root": "the root disc was drawn for another place of the camera",
    "conditioning": "the rays run along the rings' cones, where the two roots meet",
    "outside_panel": "the points lie outside the projector's image",
    "isolated": "the edges are scattered: little light, or nearly hidden",
    "depth_step": "the edges hang between surfaces, or the surface is too slanted",
}


def rejection(pairs: tuple[PairCount, ...]) -> str | None:
    """Return in words what most edges of pairs were left out for, None without any."""
    count: dict[str, int] = {}
    for pair in pairs:
        for cause, n in pair.rejected.items():
            count[cause] = count.get(cause, 0) + n
    cause = max(count, key=lambda name: count[name], default="labels")
    n_edges = sum(pair.n_edges for pair in pairs)
    if not count.get(cause, 0):
        return None
    return f"{count[cause]} of {n_edges} edges left out as `{cause}`, {_WORDS[cause]}"


@dataclass(frozen=True, eq=False)
class MeasuredClouds:
    """What a check found, for the search for causes.

    Attributes:
        plan: Of the rig.
        decoded: What each pair gave, by indices of projector and camera.
        counts: The same in numbers.
        cloud: All points, before redundancy was removed.
        expected: Samples of the target, and what the plan claims of them.
        missing: Which of those have no point, shape (n,).
    """

    plan: Scanner
    decoded: Pairs
    counts: tuple[PairCount, ...]
    cloud: Cloud
    expected: Expected
    missing: Mask


def explained(failures: tuple[str, ...], measured: MeasuredClouds) -> tuple[str, ...]:
    """Return failures of a check with what their likely causes are.

    What is wrong with devices or object as a whole explains every failure: dark
    devices, labels that contradict each other, wrong roots, a changed pose, optics or
    size. What is missing is looked at where it is missing; and what is inaccurate,
    nothing being wrong as a whole, where the points are off.

    Args:
        failures: One clause for each limit that isn't kept.
        measured: What the check found.
    """
    # Edges of disordered frames, or of two projectors at once, are no evidence.
    blurred = [*_unordered(measured), *_double_light(measured)]
    causes = [*blurred, *_dark(measured)]
    if not blurred:
        diagnosed = diagnose(measured.plan, measured.decoded)
        causes += [in_words(cause, measured.plan) for cause in diagnosed]
        causes += _wrong_roots(measured) if not diagnosed else []
    lost = _lost(measured, displaced=bool(causes))
    inaccurate = causes or [where_inaccurate(measured.plan, measured.cloud)]
    return tuple(
        "; ".join(
            [clause, *lost, *causes] if _of_coverage(clause) else [clause, *inaccurate]
        )
        for clause in failures
    )


def _of_coverage(clause: str) -> bool:
    """Whether a clause of `verdict.judge` says that something is missing."""
    return "predicted measured" in clause


def _unordered(measured: MeasuredClouds) -> list[str]:
    pairs = measured.counts
    unordered = tuple(p for p in pairs if 2 * p.rejected.get("labels", 0) > p.n_edges)
    names = ", ".join(f"{pair.projector} with {pair.camera}" for pair in unordered)
    return [f"{names}: {rejection(unordered)}"] if unordered else []


def _dark(measured: MeasuredClouds) -> list[str]:
    """Name devices that gave hardly any edge, or edges but no point."""
    counts, plan = measured.counts, measured.plan
    by_projector = {
        projector.id: [pair for pair in counts if pair.projector == projector.id]
        for projector in plan.projectors
    }
    by_camera = {
        camera.id: [pair for pair in counts if pair.camera == camera.id]
        for camera in plan.cameras
    }
    return [
        *_silent(by_projector, "no camera saw its light"),
        *_silent(by_camera, "it saw no light"),
    ]


def _silent(pairs: dict[str, list[PairCount]], dark: str) -> list[str]:
    n_edges = {name: sum(p.n_edges for p in own) for name, own in pairs.items()}
    few = _DARK_SHARE * max(n_edges.values(), default=0)
    silent: list[str] = []
    for name, own in pairs.items():
        if n_edges[name] <= few:
            why = "off, covered, blocked or aimed elsewhere"
            silent.append(f"{name} is dark: {dark}; {why}")
        elif not any(pair.n_points for pair in own):
            silent.append(f"{name} gave no point: {rejection(tuple(own))}")
    return silent


def _double_light(measured: MeasuredClouds) -> list[str]:
    """Name projectors that saturate many pixels, and what else lights these."""
    plan = measured.plan
    lit_too: dict[tuple[str, ...], list[str]] = {}
    for (p, c), pair in measured.decoded:
        n = pair.n_saturated
        lit = pair.lit_pixels + n
        if n > _SATURATED_SHARE * lit:
            others = lit_twice(plan, pair.saturated, p, c)
            names = (plan.projectors[p].id, *others)
            seen = f"{100 * n / lit:.0f} % in {plan.cameras[c].id}"
            lit_too.setdefault(names, []).append(seen)
    return [
        f"{name} saturates lit pixels, {', '.join(seen)}: "
        + (
            f"{' and '.join(others)} lights them too, on at the same time it adds up"
            if others
            else "exposed too long"
        )
        for (name, *others), seen in lit_too.items()
    ]


def _wrong_roots(measured: MeasuredClouds) -> list[str]:
    return [
        f"{projector} with {camera}: {100 * share:.0f} % of the points took the wrong "
        f"one of the two roots; the root disc isn't the one drawn for {camera}"
        for projector, camera, share in wrong_roots(measured.plan, measured.decoded)
    ]


def _lost(measured: MeasuredClouds, *, displaced: bool) -> list[str]:
    """Say where samples are missing, and why unless devices are to blame as a whole."""
    plan, missing = measured.plan, measured.missing
    samples, claimed = measured.expected.samples, measured.expected.measured
    if claimed is None or not missing.any():
        return []
    where = missing_where(plan, samples, claimed, missing)
    if displaced:
        return [where]
    hole = hole_between(plan, measured.cloud, samples, missing)
    if hole is not None:
        return [where, hole]
    cause = left_out_nearby(plan, measured.decoded, samples, missing)
    if cause is None:
        return [
            where,
            no_edges(plan, samples.points[missing], samples.normals[missing]),
        ]
    name, share = cause
    return [
        where,
        f"edges on {100 * share:.0f} % of them were left out as `{name}`, "
        f"{_WORDS[name]}",
    ]
