"""What `plan tolerance` prints."""

from collections.abc import Iterator, Sequence
from math import degrees

from planning.model.devices.calibration_errors import CalibrationErrors, Mounting
from planning.model.words import count_words, labelled, percent

from .asked import FIGURES
from .sensitivities import DIRECTIONS, UNIT_WORDS, Sensitivity
from .tolerance import TOLD, Tolerance

_ERRORS = ("rms_m", "p95_m")
# So many devices and directions are told, of either kind of harm.
_MOST = 6


def tolerance_lines(found: Tolerance) -> list[str]:
    """Return the result as text, in millimetres and degrees."""
    question = found.question
    head = [
        f"{count_words(len(found.rigs), 'drawn rig')}, seed {question.seed}"
        + "; INTERRUPTED: the same command goes on from here" * found.interrupted,
        f"mounted within {mounting_words(question.mounting)} (uniform), known once "
        f"calibrated",
        f"calibration leaves {calibration_words(question.calibration)} (normal, rms "
        f"of each device), unknown",
    ]
    return [
        *labelled("DRAWN", head),
        "",
        *_table(found),
        *labelled("MET", list(_met(found))),
        *labelled("LOOSEST", list(_loosest(found))),
        *labelled("CHECK", list(_first_order(found))),
        *_sensitive(found.sensitivities),
    ]


def mounting_words(mounting: Mounting) -> str:
    """Return the bounds of a mounting."""
    return (
        f"±{1e3 * mounting.position_m:.3g} mm, ±{degrees(mounting.angle):.3g} deg, "
        f"focal length ±{1e2 * mounting.focal:.3g} %"
    )


def calibration_words(errors: CalibrationErrors) -> str:
    """Return what a calibration leaves."""
    parts = [
        f"{value:.3g} {unit}"
        for value, unit in (
            (1e3 * errors.position_m, "mm"),
            (degrees(errors.angle), "deg"),
            (1e2 * errors.focal, "% of the focal length"),
            (errors.principal_px, "px of the principal point"),
        )
        if value
    ]
    return ", ".join(parts) or "nothing (edge noise alone)"


def _table(found: Tolerance) -> Iterator[str]:
    heads = ("as planned", "5 %", "50 %", "95 %")
    yield f"{'':41}" + "".join(f"{head:>12}" for head in heads) + f"{'asked':>12}"
    for name in TOLD:
        asked = getattr(found.asked, name, None)
        values = (getattr(found.planned, name), *found.quantiles(name))
        cells = [_cell(name, value, asked) for value in values]
        sign = "<=" if name in _ERRORS else ">="
        cells.append("" if asked is None else f"{sign} {_cell(name, asked).strip()}")
        yield (
            f"{FIGURES[name]:>41}"
            + "".join(f"{cell:>12}" for cell in cells[:-1])
            + (f"{cells[-1]:>12}")
        )
    yield ""


def _cell(name: str, value: float | None, asked: float | None = None) -> str:
    if value is None:
        return "-"
    if name in _ERRORS:
        return f"{1e3 * value:.3f}"
    return percent(value, decimals=2, asked=asked or 0.0)


def _met(found: Tolerance) -> Iterator[str]:
    n = len(found.rigs)
    if not n:
        yield "no rig was drawn"
        return
    share = percent(found.n_met / n, asked=found.quantile)
    yield (
        f"{found.n_met} of {n} rigs ({share}) meet every "
        f"requirement; {percent(found.quantile)} are asked: "
        f"{'enough' if found.passed else 'NOT ENOUGH'}"
    )
    if missed := found.missing():
        parts = [f"{FIGURES[name]} in {count}" for name, count in missed.items()]
        yield f"missed: {'; '.join(parts)}"


def _loosest(found: Tolerance) -> Iterator[str]:
    best = found.loosest
    if best is None:
        return
    met = f"{best.n_met} of {best.n_rigs} rigs, half of them drawn for this, meet all"
    if best.scale > 0.0:
        yield (
            f"{'at least ' * best.largest_tried}{mounting_words(best.mounting)}: "
            f"{best.scale:.3g} times what is stated; {met}"
        )
        return
    yield "no mounting will do, not even devices exactly as planned"
    if best.of_calibration == 0.0:
        yield "nor will any calibration with the mounting as stated"
    elif best.of_calibration < 1.0:
        yield (
            f"with the mounting as stated a calibration will do that leaves "
            f"{calibration_words(best.calibration)}, {best.of_calibration:.3g} times "
            f"what is stated; {met}"
        )


def _first_order(found: Tolerance) -> Iterator[str]:
    first, drawn = found.first_order, found.mean_square_m()
    if first is None:
        return
    if first.rms_m is not None and drawn is not None:
        yield (
            f"error to first order {1e3 * first.rms_m:.3f} mm rms, drawn "
            f"{1e3 * drawn:.3f}: ratio {drawn / first.rms_m:.3f}"
        )
    shares = [rig.coverage for rig in found.rigs]
    if not shares or not first.coverage_deviation > 0.0:
        return
    mean = sum(shares) / len(shares)
    deviation = (sum((share - mean) ** 2 for share in shares) / len(shares)) ** 0.5
    yield (
        f"coverage one direction at a time: {_points(first.coverage_shift)} in the "
        f"mean, deviation {100.0 * first.coverage_deviation:.3f}; drawn "
        f"{_points(mean - found.planned.coverage)} and {100.0 * deviation:.3f} "
        f"(percentage points): ratio {deviation / first.coverage_deviation:.2f}"
    )
    yield (
        f"at most {percent(first.near_limits)} of the target is so near a limit that "
        f"one direction alone turns it"
    )


def _points(share: float) -> str:
    return f"{100.0 * share:+.3f}"


def _sensitive(every: Sequence[Sensitivity]) -> Iterator[str]:
    """The most sensitive by either harm, the worst error first."""
    if not every:
        return
    by_error = sorted(every, key=lambda one: -one.rms_m)
    lossy = sorted(every, key=lambda one: -(one.coverage or 0.0))
    told = [*by_error[:_MOST], *(one for one in lossy[:_MOST] if one.coverage)]
    yield ""
    yield (
        "SENSITIVE  device direction        coverage lost if it stands so    "
        "rms error if nobody knows"
    )
    for one in sorted({id(one): one for one in told}.values(), key=lambda x: -x.rms_m):
        unit = UNIT_WORDS[DIRECTIONS.index(one.direction)]
        lost = (
            "stands"
            if one.coverage is None
            else f"{max(100.0 * one.coverage, 0.0):.3f}"
        )
        yield (
            f"           {one.device:<6} {one.direction:<8} {lost:>20} points a "
            f"{unit:<8} {1e3 * one.rms_m:>12.3f} mm a {unit}"
        )
    yield (
        "           across, up, along: the device's own x, y, z; tilt, pan, roll: "
        "turns about them"
    )
