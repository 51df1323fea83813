"""Figures of the check that a plan records, against those of a run again."""

from collections.abc import Mapping
from typing import Any

_MM = 1e3
# Room between two runs with different pixel noise: a share of the figure, and a floor.
_REPEATABLE = {
    "n_points": (0.05, 100.0),
    "n_merged": (0.05, 100.0),
    "redundant_fraction": (0.0, 0.03),
    "accuracy_rms_m": (0.15, 3e-6),
    "accuracy_p95_m": (0.15, 6e-6),
    "accuracy_bias_m": (0.15, 3e-6),
    "predicted_missing": (0.25, 0.01),
}
_FRACTION_SLACK = 0.025
# Of confusion tables and of parts of the surface; errors there are those of few points.
_SHARES = frozenset(
    (
        "both",
        "missing",
        "unexpected",
        "neither",
        "beside",
        "agreement",
        "trivial_agreement",
        "predicted",
        "measured",
    )
)


def compare_figures(
    recorded: Mapping[str, Any] | None, found: Mapping[str, Any]
) -> list[str]:
    """Return where a plan's recorded reconstruction differs from one run again.

    Samples and pixel noise may differ between the runs, so figures may by 5 % (counts),
    15 % (distances) or 1 to 3 points (shares), with a floor for figures near 0. Where
    much is missing that share may differ by a quarter: it comes in whole patches.
    """
    if recorded is None:
        return []
    failures: list[str] = []
    for name, (share, floor) in _REPEATABLE.items():
        claimed, value = recorded.get(name), found.get(name)
        if value is None:
            continue
        slack = max(share * abs(value), floor)
        if not _near(claimed, value, slack):
            failures.append(
                f"reconstruction.{name}: claimed {claimed}, run again {value:.6g}, "
                f"tolerance {slack:.2g}"
            )
    failures += _compare_tables(recorded, found)
    rows = recorded.get("completeness") or []
    if len(rows) != len(found["completeness"]):
        failures.append(f"reconstruction.completeness: {len(rows)} rows are claimed")
        return failures
    for claimed, row in zip(rows, found["completeness"], strict=True):
        at = row["threshold_m"]
        if not _near(claimed.get("threshold_m"), at, 1e-9) or not _near(
            claimed.get("fraction"), row["fraction"], _FRACTION_SLACK
        ):
            failures.append(
                f"reconstruction.completeness: claimed {claimed}, run again "
                f"{row['fraction']:.4f} at {_MM * at:.3g} mm, tolerance "
                f"{_FRACTION_SLACK}"
            )
    if recorded.get("passed") is True and not found["passed"]:
        failures.append(
            "reconstruction.passed: claimed true, the check run again fails"
        )
    return failures


def _compare_tables(recorded: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Hold the confusion tables, and the whole surface's row, against a run again.

    Plans from before have none; rows of single regions rest on few samples.
    """
    failures: list[str] = []
    for name in ("confusion", "dominant", "whole_surface"):
        claimed, value = recorded.get(name), found.get(name)
        if claimed is not None and value is not None:
            failures += _differing(f"reconstruction.{name}", claimed, value)
    return failures


def _differing(key: str, claimed: object, value: Mapping[str, Any]) -> list[str]:
    if not isinstance(claimed, Mapping):
        return [f"{key}: {claimed!r} is claimed, a table is expected"]
    failures: list[str] = []
    for name, own in value.items():
        if isinstance(own, Mapping):
            failures += _differing(f"{key}.{name}", claimed.get(name), own)
        elif name in _SHARES and not _near(claimed.get(name), own, _FRACTION_SLACK):
            failures.append(
                f"{key}.{name}: claimed {claimed.get(name)}, run again {own:.4f}, "
                f"tolerance {_FRACTION_SLACK}"
            )
    return failures


def contradictions(recorded: Mapping[str, Any] | None) -> list[str]:
    """Return where a recorded check contradicts itself: passed, but with failures."""
    if recorded is None:
        return []
    passed, missed = recorded.get("passed"), recorded.get("failures")
    if isinstance(missed, list) and passed is (not missed):
        return []
    return [
        f"reconstruction.passed: claimed {passed!r}, but reconstruction.failures is "
        f"{missed!r}"
    ]


def _near(claimed: object, value: float, slack: float) -> bool:
    if isinstance(claimed, bool) or not isinstance(claimed, (int, float)):
        return False
    return abs(claimed - value) <= slack
