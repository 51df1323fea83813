"""Claims of eq. (8) that follow from a plan: frames, their time, pixels, C."""

import math

from planning.model.document.plan_document import CostRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_RELATIVE = 1e-6


def audit_cost(case: AuditCase, findings: AuditFindings) -> None:
    """Eq. (8) and its terms, but for the processor times, which are as measured."""
    document, findings = case.plan.document, findings.at("cost")
    cost, cameras = document.cost, document.cameras
    count, before = len(cameras), cost.n_cameras_before
    pixels = sum(math.prod(camera.resolution) for camera in cameras)
    findings.number("pixels", cost.pixels, pixels, 0.0, "px")
    whose = "certificates.cameras.greedy_count"
    greedy = document.certificates.cameras.greedy_count
    findings.same("n_cameras_before", before, greedy, whose)
    frames = _frames(case.plan, count)
    findings.number("n_frames", cost.n_frames, frames, 0.0, "")
    frame_s = _frame_time(case.plan)
    whose = "rates and exposure under rig.*.figures"
    truths = [("frame_s", frame_s, whose)]
    a_pixel = None if frame_s is None else frames * frame_s / max(pixels, 1)
    truths.append(("t1", a_pixel, "n_frames x frame_s / pixels"))
    for name, number, every in (
        ("C", count, False),
        ("C_before", before, False),
        ("C_all_rings", count, True),
    ):
        shown = _frames(case.plan, number, left_out=every)
        acquired = None if frame_s is None else shown * frame_s
        total = _total(cost, acquired, pixels * number / max(count, 1))
        truths.append((name, total, "the sum of its terms"))
    for name in ("t2", "t3", "t4", "t5", "render_s"):
        term = getattr(cost, name)
        findings.holds(term is None or term >= 0.0, name, f"{term!r} s is no time")
    for name, truth, whose in truths:
        slack = _RELATIVE * abs(truth or 0.0)
        findings.same(name, getattr(cost, name), truth, whose, slack)


def _frames(plan: RigPlan, n_cameras: int, *, left_out: bool = False) -> int:
    """White and black; a code for each annulus, a disc for each camera; inverses.

    Perhaps with the rings that were left out. Of a dense code a bit for each halving
    of the panel's width and height down to half a period, or to a pixel; and sinusoids.
    """
    if not plan.document.projectors:
        # All cameras see the object as it is, once.
        return 1
    coded = 0
    for projector in plan.document.projectors:
        if (code := projector.code) is not None:
            stripe = code.period_px / 2 if code.shifts else 1
            halvings = (math.log2(side / stripe) for side in projector.resolution)
            bits = sum(max(1, math.ceil(each - 1e-9)) for each in halvings)
            coded += bits + code.shifts + 1
            continue
        n_annuli = len(projector.ring_radii) + 1
        if left_out and projector.rings is not None:
            n_annuli += len(projector.rings.left_out)
        coded += math.ceil(math.log2(n_annuli)) + n_cameras + 1
    return 2 * coded


def _frame_time(plan: RigPlan) -> float | None:
    """Refreshes of the slowest projector until every camera is ready again."""
    rig = plan.document.rig
    cameras = rig.figures_of("camera", (one.model for one in plan.cameras))
    lamps = rig.figures_of("projector", (one.model for one in plan.projectors))
    rate = min(figures.frame_rate_hz or 0.0 for figures in cameras)
    if not plan.document.projectors:
        exposed = 1e-3 * max(figures.exposure_ms or 0 for figures in cameras)
        return max(1.0 / rate, exposed) if rate > 0.0 else None
    refresh = min(figures.frame_rate_hz or 0.0 for figures in lamps)
    if not (rate > 0.0 and refresh > 0.0):
        return None
    planned = [one.exposure_s for one in plan.projectors if one.exposure_s is not None]
    exposed = (
        max(planned) if planned else 1e-3 * max(f.exposure_ms or 0 for f in cameras)
    )
    longest = max(1.0 / rate, exposed)
    refreshes = longest * refresh * (1.0 - _RELATIVE)
    return max(math.ceil(refreshes), 1) / refresh if math.isfinite(refreshes) else None


def _total(cost: CostRecord, acquired: float | None, pixels: float) -> float | None:
    """Eq. (8); None where a term isn't known."""
    terms = acquired, cost.t2, cost.t3, cost.t4, cost.t5
    if any(term is None or not term >= 0.0 for term in terms):
        return None
    t1, t2, t3, t4, t5 = (term or 0.0 for term in terms)
    return t1 + pixels * t2 + t3 + t4 + t5
