"""What a plan says of measuring several times, and of the loss of any one device."""

from collections.abc import Iterator

from planning.model.devices.calibration_errors import Survival
from planning.model.document.survival_records import (
    LossRecord,
    SurvivalRecord,
    SurvivingCountRecord,
)
from planning.model.plan import RigPlan
from planning.model.words import count_words, labelled, percent
from planning.report.entries.survival_entries import falls_short_after


def survival_lines(plan: RigPlan) -> list[str]:
    """Return what is left after each loss, and what that costs."""
    record, asked = plan.document.survival, plan.requirements.survival
    if record is None or asked is None:
        return []
    width = max(len(loss.lost or "all there") for loss in record.losses)
    lines = [
        f"any {count_words(asked.survive, 'device')} may be lost, what counts is "
        f"measured by {pairs_words(asked.views)} at least",
        *(
            f"{loss.lost or 'all there':<{width}}  lit {lit_words(plan, loss)}, "
            f"measured {measured_words(plan, loss)} of what can be"
            f"{_of_target(plan, loss)}{_regions(loss)}{_short(plan, loss)}"
            for loss in record.losses
        ),
    ]
    if not asked.survive:
        lines[0] = f"what counts is measured by {pairs_words(asked.views)} at least"
    if cost := survival_cost(record, asked):
        lines.append(cost)
    return labelled("LOSSES" if asked.survive else "VIEWS", lines)


def surviving_proofs(plan: RigPlan) -> list[str]:
    """Return what was proved of the numbers that survival takes, a line a kind."""
    record, asked = plan.document.survival, plan.requirements.survival
    if record is None or asked is None:
        return []
    return [
        f"{'CLAIMED' if is_fewest(count) else 'BOUND':<9}{proof_words(kind, count)} "
        f"{purpose(asked)}"
        for kind, count in _counts(record)
        if kind == "camera" or asked.survive
    ]


def counted_words(plan: RigPlan) -> list[str]:
    """Return what was proved of the number of each kind of device."""
    record = plan.document.survival
    counts = _counts(record) if record is not None else ()
    return [proof_words(kind, count) for kind, count in counts]


def losses_words(plan: RigPlan) -> tuple[str, str] | None:
    """Return a label, and what a loss leaves at worst and costs to stand."""
    record, asked = plan.document.survival, plan.requirements.survival
    if record is None or asked is None:
        return None
    parts = (worst_losses(plan), survival_cost(record, asked))
    label = "LOSSES" if asked.survive else "VIEWS"
    return label, "; ".join(filter(None, parts))


def by_several_pairs(plan: RigPlan) -> str:
    """Return the share that as many pairs measure as are asked for, where several."""
    record, asked = plan.document.survival, plan.requirements.survival
    if record is None or asked is None or asked.views == 1:
        return ""
    whole = next(loss for loss in record.losses if not loss.lost)
    return f"{measured_words(plan, whole)} by {pairs_words(asked.views)}"


def proof_words(kind: str, count: SurvivingCountRecord) -> str:
    """Return what was proved of a number of devices."""
    devices, least = count_words(count.count, kind), count.lower_bound
    everywhere = count.everywhere
    over = "" if everywhere is None else f", {everywhere} over every pose"
    if count.needed > count.count:
        return f"{devices}; {count.needed} suffice, at least {least} are needed{over}"
    if is_fewest(count):
        return f"{devices}: the fewest of the candidates (at least {least}{over})"
    return f"{devices}; at least {least} of the candidates are needed{over}"


def purpose(asked: Survival) -> str:
    """Say what for devices are counted."""
    parts: list[str] = []
    if asked.survive:
        parts.append("to do without any one device")
    if asked.views > 1:
        parts.append(f"to measure by {pairs_words(asked.views)}")
    return " and ".join(parts)


def is_fewest(count: SurvivingCountRecord) -> bool:
    """Whether no fewer devices are enough, which was proved over the candidates."""
    return count.count == count.needed <= count.lower_bound


def survival_cost(record: SurvivalRecord, asked: Survival) -> str:
    """Return how many devices more survival takes; nothing where none was sought."""
    counts = list(_counts(record))
    if not counts:
        return ""
    more = [
        f"{count_words(count.count - count.without, kind)}"
        for kind, count in counts
        if count.count != count.without
    ]
    what = "surviving any one device" if asked.survive else "so many pairs"
    if asked.survive and asked.views > 1:
        what = f"{pairs_words(asked.views)}, whatever device is lost,"
    plain = " + ".join(str(count.without) for _, count in counts)
    verb = "cost" if what.startswith("so") or "," in what else "costs"
    return (
        f"{what} {verb} {' and '.join(more) + ' more' if more else 'no device more'} "
        f"({plain} without)"
    )


def worst_losses(plan: RigPlan) -> str:
    """Return after which loss least is lit, and after which least is measured."""
    record = plan.document.survival
    losses = [loss for loss in record.losses if loss.lost] if record else []
    if not losses:
        return ""
    dark, blind = min(losses, key=lit_share), min(losses, key=measured_share)
    return (
        f"at worst lit {lit_words(plan, dark)} without {dark.lost} and measured "
        f"{measured_words(plan, blind)} without {blind.lost}"
    )


def lit_share(loss: LossRecord) -> float:
    """Lit of what can be lit."""
    whole = loss.reachable_by_projectors_m2
    return loss.lit_m2 / whole if whole > 0.0 else 0.0


def measured_share(loss: LossRecord) -> float:
    """Measured of what can be."""
    whole = loss.reachable_by_cameras_m2
    return loss.measured_m2 / whole if whole > 0.0 else 0.0


def lit_words(plan: RigPlan, loss: LossRecord) -> str:
    """Return that share in percent, rounded down if less than is asked."""
    return percent(lit_share(loss), asked=plan.requirements.dominant_coverage)


def measured_words(plan: RigPlan, loss: LossRecord) -> str:
    """Likewise of what is measured."""
    return percent(measured_share(loss), asked=plan.requirements.coverage)


def pairs_words(views: int) -> str:
    """Return so many pairs in words."""
    return "one pair" if views == 1 else f"{views} pairs"


def _counts(record: SurvivalRecord) -> Iterator[tuple[str, SurvivingCountRecord]]:
    for kind in ("projector", "camera"):
        count = getattr(record, f"{kind}s")
        if count is not None:
            yield kind, count


def _of_target(plan: RigPlan, loss: LossRecord) -> str:
    whole = plan.coverage.target.area_m2
    return f", {percent(loss.measured_m2 / whole)} of the target" if whole > 0 else ""


def _regions(loss: LossRecord) -> str:
    if not loss.floors_missed:
        return ""
    names = ", ".join(map(str, loss.floors_missed))
    return f"; below its floor: region {names}"


def _short(plan: RigPlan, loss: LossRecord) -> str:
    return "; MISSED" if any(falls_short_after(loss, plan.requirements)) else ""
