"""Whether a plan meets what was asked: every figure against its limit."""

from collections.abc import Iterator
from html import escape

from planning.model.plan import RigPlan
from planning.model.words import percent
from planning.report.summary.check_lines import unchecked
from planning.report.summary.devices.device_lines import devices_words
from planning.report.summary.devices.station_lines import title_words
from planning.report.summary.shortfall import shortfalls

from .markup import element, paragraphs, table

# So many misses are told at once.
_TOLD = 3
_MET, _MISSED, _NOT_CHECKED = "met", "NOT MET", "NOT CHECKED"


def verdict(plan: RigPlan) -> str:
    """Return the verdict, why not if not, a summary, and the table of requirements."""
    missed = shortfalls(plan)
    words = "NOT MET" if missed else "Every requirement is met"
    loose = unchecked(plan)
    kind = "missed" if missed else "loose" if loose else "met"
    if loose:
        words += f"; {loose}: no reconstruction from pixels was made"
    if plan.document.truncated:
        words += "; TRUNCATED: the run was cut"
    head = element("p", words, class_=f"verdict {kind}", id="verdict")
    why = paragraphs(missed[:_TOLD], class_="why")
    if more := missed[_TOLD:]:
        title = element("summary", f"{len(more)} more")
        why += element("details", title + paragraphs(more, class_="why"))
    rows = list(_rows(plan))
    short = element("p", escape(headline(plan)))
    columns = ("what", "asked", "is", "verdict")
    return head + why + short + table("Requirements", columns, rows)


def headline(plan: RigPlan) -> str:
    """Return what the plan is, for a person, in a sentence or two."""
    document, areas = plan.document, plan.coverage.target
    devices = f"{devices_words(plan)} with {document.rig.light} light"
    if plan.cameras_alone:
        devices = f"{devices_words(plan)} alone, by the object's texture,"
    if document.stations is not None:
        devices = f"{title_words(document)}, each of them by {devices}"
        if document.stations.kind == "heads":
            devices = f"{title_words(document)}, of {devices_words(plan)},"
    target = {
        "dominant": "dominant regions",
        "surface": "whole surface",
        "outside": "part of the surface that lies outside",
    }
    sigma = plan.coverage.sigma
    exact = (
        ""
        if sigma is None
        else (
            f" Points are predicted with a standard deviation of "
            f"{1e3 * sigma.median_m:.3f} mm (median), 95 % within "
            f"{1e3 * sigma.p95_m:.3f} mm."
        )
    )
    return (
        f"{devices} (rig {document.rig.name!r}) "
        f"measure {percent(areas.measured_m2 / max(areas.area_m2, 1e-300))} of the "
        f"target, the {target[plan.requirements.target]}.{exact}"
    )


def _rows(plan: RigPlan) -> Iterator[tuple[str, str, str, str]]:
    asked, areas = plan.requirements, plan.coverage.target
    for kind, most, have in (
        ("projectors", asked.max_projectors, len(plan.projectors)),
        ("cameras", asked.max_cameras, len(plan.cameras)),
    ):
        alone = plan.cameras_alone and kind == "projectors"
        # Of stations it counts a device anew wherever it stands.
        if most is not None and not alone and plan.document.stations is None:
            yield kind, f"at most {most}", str(have), _judged(have <= most)
    for what, part, whole, least in (
        (
            "target within reach of projectors",
            areas.reachable_by_projectors_m2,
            areas.area_m2,
            asked.min_reachable,
        ),
        (
            f"{'target' if plan.cameras_alone else 'what is lit'} within reach of "
            f"cameras",
            areas.reachable_by_cameras_m2,
            areas.lit_m2,
            asked.min_reachable,
        ),
        (
            "target lit, of what projectors can reach",
            areas.lit_m2,
            areas.reachable_by_projectors_m2,
            asked.dominant_coverage,
        ),
        (
            "target measured, of what cameras can reach",
            areas.measured_m2,
            areas.reachable_by_cameras_m2,
            asked.coverage,
        ),
    ):
        share = part / whole if whole > 0.0 else 0.0
        if plan.cameras_alone and "projectors" in what:
            continue
        yield (
            what,
            f"at least {percent(least)}",
            percent(share, asked=least),
            _judged(share >= least),
        )
    if asked.region_coverage and (large := plan.large_regions):
        below = sum(
            region.coverage is not None and region.coverage.floor == "missed"
            for region in large
        )
        floor = f"{percent(asked.region_coverage)} of each of {len(large)}"
        met = f"{len(large) - below} of {len(large)}"
        yield "floor of large regions", floor, met, _judged(not below)
    robust = plan.document.robust
    if robust is not None:
        met = f"{robust.n_met} of {robust.n_drawn}"
        enough = _judged(robust.n_met >= robust.least)
        yield "drawn rigs that meet it", f"at least {robust.least}", met, enough
    yield from _check_rows(plan)


def _check_rows(plan: RigPlan) -> Iterator[tuple[str, str, str, str]]:
    limits, check = plan.requirements.check, plan.document.reconstruction
    for what, limit, value in (
        ("check: rms error", limits.max_rms_m, check and check.accuracy_rms_m),
        ("check: 95th percentile", limits.max_p95_m, check and check.accuracy_p95_m),
        ("check: bias", limits.max_bias_m, check and check.accuracy_bias_m),
    ):
        at_most = f"at most {1e3 * limit:g} mm"
        if value is None:
            yield what, at_most, "", _NOT_CHECKED if check is None else _MISSED
        else:
            yield what, at_most, f"{1e3 * value:.3f} mm", _judged(abs(value) <= limit)
    tau = f"{1e3 * limits.tau_m:.1f} mm"
    near = None
    if check is not None:
        steps = {step.threshold_m: step.fraction for step in check.completeness}
        near = steps[min(steps, key=lambda m: abs(m - limits.tau_m))] if steps else None
    missing = None if check is None else check.predicted_missing
    least, most = limits.min_completeness, limits.max_predicted_missing
    for what, bound, told, holds in (
        (
            f"check: has a point within {tau}, of what is predicted measured",
            f"at least {percent(least)}",
            "" if near is None else percent(near, decimals=2, asked=least),
            near is not None and near >= least,
        ),
        (
            f"check: has none within {tau} of what is predicted measured",
            f"at most {percent(most)}",
            "" if missing is None else percent(missing, decimals=2, most=most),
            missing is not None and missing <= most,
        ),
    ):
        yield what, bound, told, _NOT_CHECKED if check is None else _judged(holds)
    if check is not None and not check.passed:
        yield "check", "passed", "failed", _MISSED


def _judged(holds: bool) -> str:
    return _MET if holds else _MISSED
