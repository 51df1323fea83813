"""Quantities as a person reads them."""

from collections.abc import Sequence

from .requirements import CheckLimits

# Areas below this are told in mm² [m²].
_SMALL_M2 = 1e-4


def area_words(area_m2: float) -> str:
    """Return an area in cm², or a small one in mm²."""
    if area_m2 < _SMALL_M2:
        return f"{1e6 * area_m2:.3g} mm²"
    return f"{1e4 * area_m2:.1f} cm²"


def count_words(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is 1."""
    return f"{count} {noun}{'s' * (count != 1)}"


def error_words(rms_m: float, p95_m: float, bias_m: float, limits: CheckLimits) -> str:
    """Return the errors of points from the surface in mm, each with its limit."""
    return (
        f"rms {1e3 * rms_m:.3f} mm (limit {1e3 * limits.max_rms_m:g}), "
        f"p95 {1e3 * p95_m:.3f} ({1e3 * limits.max_p95_m:g}), "
        f"bias {1e3 * bias_m:+.3f} ({1e3 * limits.max_bias_m:g})"
    )


def percent(share: float, *, decimals: int = 1) -> str:
    """Return a share in percent."""
    return f"{100.0 * share:.{decimals}f} %"


def labelled(label: str, lines: Sequence[str]) -> list[str]:
    """Return lines of a block of the summary: its label stands before the first."""
    return [f"{'' if k else label:<9}{line}" for k, line in enumerate(lines)]
