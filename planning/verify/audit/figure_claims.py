"""Figures of the check that a plan records, against those of a run again."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import cast

from planning.model.document.check_records import ConfusionRecord, ReconstructionRecord
from planning.model.document.part import Part
from planning.model.requirements import CheckLimits

from .audit_case import AuditCase
from .audit_findings import AuditFindings

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
# Room light is a mean over projectors, which versions of libraries may round otherwise.
_ROUNDING = 1e-9
# What follows from failures, and of which plan the check was.
_VERDICT = re.compile("passed|plan|asked")
# So many figures that differ are told.
_MOST_TOLD = 8
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
    findings = AuditFindings("reconstruction")
    for name, (share, floor) in _REPEATABLE.items():
        claimed, value = getattr(recorded, name), getattr(fresh, name)
        if value is not None:
            slack = max(share * abs(value), floor)
            findings.number(name, claimed, value, slack, "")
    # Plans from before have none; rows of single regions rest on few samples.
    for name in ("confusion", "dominant", "whole_surface"):
        tables = getattr(recorded, name), getattr(fresh, name)
        _compare_shares(*tables, findings.at(name))
    bounced, again = recorded.interreflection, fresh.interreflection
    if bounced is not None and again is not None:
        # Few paths are followed, of other points.
        slack = max(0.25 * again.biased, 0.02)
        key = "interreflection.biased"
        findings.number(key, bounced.biased, again.biased, slack, "")
    rows, key = recorded.completeness, "completeness"
    if len(rows) != len(fresh.completeness):
        findings.fail(key, f"{len(rows)} rows are claimed")
        return list(findings.failures)
    for row, again in zip(rows, fresh.completeness, strict=True):
        at = f"{key} at {_MM * again.threshold_m:.3g} mm"
        findings.number(at, row.threshold_m, again.threshold_m, 1e-9, "m")
        findings.number(at, row.fraction, again.fraction, _FRACTION_SLACK, "")
    findings.holds(
        fresh.passed or not recorded.passed,
        "passed",
        "claimed true, the check run again fails",
    )
    return list(findings.failures)


def compare_exactly(
    recorded: ReconstructionRecord, fresh: ReconstructionRecord
) -> list[str]:
    """Return where a recorded reconstruction isn't to the last digit one run again.

    For what made it and its seed are the same: then so is every figure, and every word
    of a failure. What it says of passing is another claim (`compare_figures`).
    """
    findings = AuditFindings("reconstruction")
    documents = (record.to_document() for record in (recorded, fresh))
    claimed, again = (
        {key: value for key, value in _leaves(document) if not _VERDICT.fullmatch(key)}
        for document in documents
    )
    differ = [
        key
        for key in dict.fromkeys((*claimed, *again))
        if claimed.get(key) != again.get(key)
    ]
    for key in differ[:_MOST_TOLD]:
        ours, theirs = (d.get(key, "nothing") for d in (claimed, again))
        findings.fail(key, f"claimed {ours!r}, the same check again gives {theirs!r}")
    if len(differ) > _MOST_TOLD:
        findings.fail("", f"{len(differ) - _MOST_TOLD} more figures differ")
    return list(findings.failures)


def _leaves(value: object, key: str = "") -> Iterator[tuple[str, object]]:
    """Yield all values of a document with their keys, empty lists and objects too."""
    parts: Iterable[tuple[object, object]] = ()
    if isinstance(value, Mapping):
        parts = cast(Mapping[object, object], value).items()
    elif isinstance(value, Sequence) and not isinstance(value, str):
        parts = enumerate(cast(Sequence[object], value))
    empty = True
    for name, part in parts:
        empty = False
        yield from _leaves(part, f"{key}.{name}" if key else str(name))
    if empty:
        yield key, value


def contradictions(
    recorded: ReconstructionRecord, ambient: float, digest: str
) -> list[str]:
    """Return where a recorded check contradicts itself, or the plan that it stands in.

    Passed, but with failures; in other room light than the plan's, a share of the
    projectors'; of a plan with another digest: a claim, pose, limit or requirement was
    edited after the check.
    """
    findings = AuditFindings("reconstruction")
    findings.holds(
        recorded.passed is (not recorded.failures),
        "passed",
        f"claimed {recorded.passed!r}, but reconstruction.failures is "
        f"{list(recorded.failures)!r}",
    )
    findings.holds(
        recorded.plan in (None, digest),
        "plan",
        f"the check was of a plan with digest {(recorded.plan or '')[:16]}, and this "
        f"one has {digest[:16]}: what was planned or asked was edited after the check",
    )
    if recorded.ambient is not None:
        whose = "the room light that the plan states"
        findings.same("ambient", recorded.ambient, ambient, whose, _ROUNDING)
    return list(findings.failures)


def audit_check(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the failures of a recorded check are those that its figures say.

    Each begins with the limit that isn't kept, in the order in which limits are looked
    at; what follows are likely causes, which only a check again gives.
    """
    recorded = case.plan.document.reconstruction
    if recorded is None:
        return
    clauses = _missed(recorded, case.plan.requirements.check)
    told = recorded.failures
    findings.holds(
        len(told) == len(clauses) and all(map(str.startswith, told, clauses)),
        "reconstruction.failures",
        f"claimed {list(told)!r}, but by its figures and limits they are {clauses!r}",
    )


def _missed(recorded: ReconstructionRecord, limits: CheckLimits) -> list[str]:
    """Return how each failure begins: the limit that the figures miss, and by what."""
    rms, p95 = recorded.accuracy_rms_m, recorded.accuracy_p95_m
    bias, missing = recorded.accuracy_bias_m, recorded.predicted_missing
    if rms is None or p95 is None or bias is None:
        return ["no point was measured"]
    lengths = (
        ("rms distance of the points from the mesh", rms, limits.max_rms_m),
        ("95th percentile of the distance", p95, limits.max_p95_m),
        ("mean signed distance", bias, limits.max_bias_m),
    )
    clauses = [
        f"{name} is {_MM * value:.3f} mm, limit {_MM * limit:.3f} mm"
        for name, value, limit in lengths
        if abs(value) > limit
    ]
    if missing is None or len(recorded.completeness) < 2:
        return clauses
    row = recorded.completeness[1]
    if row.fraction < limits.min_completeness:
        clauses.append(
            f"completeness is {row.fraction:.3f} of the target predicted measured at "
            f"{_MM * row.threshold_m:.2f} mm, limit {limits.min_completeness:.3f}"
        )
    if missing > limits.max_predicted_missing:
        clauses.append(
            f"{100 * missing:.2f} % of the samples predicted measured have no point "
            f"within {_MM * row.threshold_m:.2f} mm, limit "
            f"{100 * limits.max_predicted_missing:.2f} %"
        )
    return clauses


def _compare_shares(
    recorded: Part | None, fresh: Part | None, findings: AuditFindings
) -> None:
    if recorded is None or fresh is None:
        return
    for name in type(fresh).model_fields:
        claimed, value = getattr(recorded, name), getattr(fresh, name)
        if isinstance(value, Part):
            _compare_shares(claimed, value, findings.at(name))
        elif name in _SHARES and value is not None:
            findings.number(name, claimed, value, _FRACTION_SLACK, "")
