"""Figures of the check that a plan records, against those of a run again."""

from planning.model.document.check_records import ConfusionRecord, ReconstructionRecord
from planning.model.document.part import Part

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
# Errors of parts of the surface are those of few points, and not compared.
_SHARES = {*ConfusionRecord.model_fields, "predicted", "measured"}


def compare_figures(
    recorded: ReconstructionRecord | None, fresh: ReconstructionRecord
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
        claimed, value = getattr(recorded, name), getattr(fresh, name)
        slack = max(share * abs(value or 0.0), floor)
        failures += _apart(name, claimed, value, slack)
    # Plans from before have none; rows of single regions rest on few samples.
    for name in ("confusion", "dominant", "whole_surface"):
        failures += _differing(name, getattr(recorded, name), getattr(fresh, name))
    rows, key = recorded.completeness, "completeness"
    if len(rows) != len(fresh.completeness):
        return [*failures, f"reconstruction.{key}: {len(rows)} rows are claimed"]
    for row, again in zip(rows, fresh.completeness, strict=True):
        at = f"{key} at {_MM * again.threshold_m:.3g} mm"
        failures += _apart(at, row.threshold_m, again.threshold_m, 1e-9)
        failures += _apart(at, row.fraction, again.fraction, _FRACTION_SLACK)
    if recorded.passed and not fresh.passed:
        failures.append(
            "reconstruction.passed: claimed true, the check run again fails"
        )
    return failures


def contradictions(recorded: ReconstructionRecord | None) -> list[str]:
    """Return where a recorded check contradicts itself: passed, but with failures."""
    if recorded is None or recorded.passed is (not recorded.failures):
        return []
    return [
        f"reconstruction.passed: claimed {recorded.passed!r}, but "
        f"reconstruction.failures is {list(recorded.failures)!r}"
    ]


def _differing(key: str, recorded: Part | None, fresh: Part | None) -> list[str]:
    """Return which shares of a table differ; nothing where there is no table."""
    if recorded is None or fresh is None:
        return []
    failures: list[str] = []
    for name in type(fresh).model_fields:
        claimed, value = getattr(recorded, name), getattr(fresh, name)
        if isinstance(value, Part):
            failures += _differing(f"{key}.{name}", claimed, value)
        elif name in _SHARES:
            failures += _apart(f"{key}.{name}", claimed, value, _FRACTION_SLACK)
    return failures


def _apart(
    key: str, claimed: float | None, value: float | None, slack: float
) -> list[str]:
    """Return the sentence that a figure differs from a run again, if it does."""
    if value is None or (claimed is not None and abs(claimed - value) <= slack):
        return []
    return [
        f"reconstruction.{key}: claimed {claimed}, run again {value:.6g}, "
        f"tolerance {slack:.2g}"
    ]
