"""Claims about heads, stations and steps: who is where, and how many are needed."""

from planning.model.document.station_records import StationCount, StationsRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .head_claims import audit_heads, audit_reference_heads
from .step_claims import audit_steps


def audit_stations(case: AuditCase, findings: AuditFindings) -> None:
    """Check that devices stand where their stations say, and the count of these."""
    plan, told = case.plan, case.plan.document.stations
    below = findings.at("stations")
    if told is None:
        named = [d.id for d in (*plan.projectors, *plan.cameras) if d.station]
        below.holds(not named, "", f"{named} name a station, and there is none")
        return
    _audit_members(plan, told, below)
    if told.kind == "turntable":
        audit_steps(plan, told, below)
    else:
        audit_heads(plan, told, case, below)
    audit_reference_heads(plan, told, below)
    ids = [one.id for one in told.stations]
    below.holds(len(set(ids)) == len(ids), "", f"{ids} aren't all different")
    if below.holds(told.count is not None, "count", "is missing") and told.count:
        _audit_count(plan, told, told.count, below.at("count"))


def _audit_members(
    plan: RigPlan, told: StationsRecord, findings: AuditFindings
) -> None:
    """Every device is at one station, and names it unless heads count across."""
    kinds = (("projectors", plan.projectors), ("cameras", plan.cameras))
    for kind, devices in kinds:
        names = [name for one in told.stations for name in getattr(one, kind)]
        there = [device.id for device in devices]
        findings.holds(
            names == there, kind, f"stations hold {names}, the plan has {there}"
        )
        at = {name: one.id for one in told.stations for name in getattr(one, kind)}
        for device in devices:
            claimed = "" if told.cross else at.get(device.id, "")
            findings.holds(
                device.station == claimed,
                f"{device.id}.station",
                f"{device.station!r} is claimed, but stations put it at {claimed!r}",
            )


def _audit_count(
    plan: RigPlan, told: StationsRecord, count: StationCount, findings: AuditFindings
) -> None:
    n, known = len(told.stations), count.needed is not None
    needed = count.needed or 0
    findings.same("count", count.count, n, "the number of stations")
    for key, least in (
        ("lower_bound", count.lower_bound),
        ("everywhere", count.everywhere or 0),
    ):
        findings.holds(
            0 <= least and (least <= needed or not known),
            key,
            f"{least} must be at most needed = {needed}",
        )
    findings.holds(
        count.greedy is None or count.greedy >= count.lower_bound,
        "greedy",
        f"{count.greedy} is fewer than the bound of {count.lower_bound}",
    )
    findings.holds(
        max(count.lit, count.measured) <= count.n_samples,
        "n_samples",
        f"{count.lit} lit and {count.measured} measured of {count.n_samples}",
    )
    if told.kind == "turntable":
        _audit_trade(told, count, findings)
        return
    head = plan.document.rig.head
    most, each = plan.requirements.max_projectors, 1
    if head is not None:
        each = sum(device.kind == "projector" for device in head.devices)
    # More suffice than are planned only where no more may be, or have room.
    findings.holds(
        needed <= n or n * each == most or (head is not None and head.body is not None),
        "needed",
        f"{needed} are claimed to suffice, {n} are planned of {most // each} allowed",
    )
    of_candidates = told.n_reference - n
    findings.same(
        "n_candidates", count.n_candidates, of_candidates, "the reference heads"
    )


def _audit_trade(
    told: StationsRecord, count: StationCount, findings: AuditFindings
) -> None:
    """Numbers of devices each once, and the row of the plan's own is its count."""
    if not findings.holds(told.stations, "stations", "are none, of a turntable"):
        return
    one = told.stations[0]
    own = len(one.projectors), len(one.cameras)
    rows = {(row.projectors, row.cameras): row for row in told.steps}
    findings.holds(
        len(rows) == len(told.steps) and own in rows,
        "steps",
        f"rows of {sorted(rows)}: each once, among them the plan's own {own}",
    )
    for row in told.steps:
        findings.holds(
            row.steps is None or row.lower_bound <= row.steps,
            "steps",
            f"{row.steps} steps with a bound of {row.lower_bound}",
        )
    if own in rows:
        row = rows[own]
        findings.holds(
            (row.steps, row.lower_bound) == (count.needed, count.lower_bound)
            and (count.needed or 0) <= count.count,
            "needed",
            f"{count.needed}, at least {count.lower_bound}, of {count.count} steps; "
            f"the table has {row.steps}, at least {row.lower_bound}",
        )
