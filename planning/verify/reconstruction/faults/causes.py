"""What the errors of a reconstruction point at, in words."""

import numpy as np

from .cause_words import in_words
from .diagnosis import diagnose
from .inaccurate import where_inaccurate, wrong_roots
from .measured_clouds import MeasuredClouds, rejection
from .missing import lit_twice, where_missing
from .supposed import Evidence

# A device whose edges are fewer than this share of what its role gives is all but dark.
_DARK_SHARE = 0.01
# So many of the lit pixels may be saturated by highlights; more are told where nothing
# else is wrong, and beyond the second share edges are no evidence.
_HIGHLIGHTS, _BLOWN = 0.05, 0.2


def explained(failures: tuple[str, ...], measured: MeasuredClouds) -> tuple[str, ...]:
    """Return failures of a check with what their likely causes are, each told once.

    What is wrong with devices or object as a whole explains every failure: dark
    devices, labels that contradict each other, wrong roots, a changed pose, optics or
    size. What is missing is looked at where it is missing; and what is inaccurate,
    nothing being wrong as a whole, where the points are off.
    """
    plan, decoded = measured.plan, measured.decoded
    # Edges of disordered frames, or of two projectors at once, are no evidence.
    saturated, blown = _saturated(measured)
    blurred = [*_unordered(measured), *(saturated if blown else [])]
    causes = [*blurred, *_dark(measured)]
    remark: str | None = None
    if not blurred:
        diagnosed = diagnose(plan, Evidence.of(plan, decoded))
        causes += [in_words(cause, plan) for cause in diagnosed.causes]
        causes += wrong_roots(plan, decoded) if not diagnosed.causes else []
        remark = diagnosed.remark
    missing = where_missing(measured, displaced=bool(causes))
    causes = causes or saturated
    incomplete = missing + causes
    inaccurate = causes or [remark or where_inaccurate(plan, measured.cloud)]
    # So `judge` words that something is missing.
    absent = "predicted measured"
    sentences: list[str] = []
    told: set[str] = set()
    for clause in failures:
        likely = incomplete if absent in clause else inaccurate
        again = ["likely as above"] if told.intersection(likely) else []
        fresh = [cause for cause in likely if cause not in told]
        sentences.append("; ".join([clause, *fresh, *again]))
        told.update(likely)
    return tuple(sentences)


def _unordered(measured: MeasuredClouds) -> list[str]:
    pairs = measured.counts
    unordered = tuple(p for p in pairs if 2 * p.rejected.get("labels", 0) > p.n_edges)
    names = ", ".join(f"{pair.projector} with {pair.camera}" for pair in unordered)
    return [f"{names}: {rejection(unordered)}"] if unordered else []


def _dark(measured: MeasuredClouds) -> list[str]:
    """Name devices that gave hardly any edge, or edges but no point."""
    roles = (
        ("projector", measured.plan.projectors, "no camera saw its light"),
        ("camera", measured.plan.cameras, "it saw no light"),
    )
    words: list[str] = []
    for axis, (role, devices, dark) in enumerate(roles):
        pairs = {
            device.id: [p for p in measured.counts if getattr(p, role) == device.id]
            for device in devices
        }
        n_edges = {name: sum(p.n_edges for p in each) for name, each in pairs.items()}
        few = _DARK_SHARE * max(n_edges.values(), default=0)
        promised = measured.expected.by_pair
        for k, (name, each) in enumerate(pairs.items()):
            if promised is not None and not np.any(np.take(promised, k, axis)):
                # No pair of it was to measure anything, so that it shows no fault.
                continue
            if n_edges[name] <= few:
                why = "off, covered, blocked or aimed elsewhere"
                words.append(f"{name} is dark: {dark}; {why}")
            elif not any(pair.n_points for pair in each):
                words.append(f"{name} gave no point: {rejection(tuple(each))}")
    return words


def _saturated(measured: MeasuredClouds) -> tuple[list[str], bool]:
    """Name projectors that saturate many pixels, and what else lights these.

    And whether that are so many that edges are no evidence.
    """
    plan, blown = measured.plan, False
    lit_too: dict[tuple[str, ...], list[str]] = {}
    for (p, c), pair in measured.decoded:
        n = pair.n_saturated
        lit = pair.lit_pixels + n
        if n > _HIGHLIGHTS * lit:
            blown = blown or n > _BLOWN * lit
            others = lit_twice(measured.supposed, pair.saturated, p, c)
            names = (plan.projectors[p].id, *others)
            seen = f"{100 * n / lit:.0f} % in {plan.cameras[c].id}"
            lit_too.setdefault(names, []).append(seen)
    words = [
        f"{name} saturates lit pixels, {', '.join(seen)}: "
        + (
            f"{' and '.join(others)} light{'s' * (len(others) == 1)} them too, on at "
            f"the same time it adds up"
            if others
            else "exposed too long"
        )
        for (name, *others), seen in lit_too.items()
    ]
    return words, blown
