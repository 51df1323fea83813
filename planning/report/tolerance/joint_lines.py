"""What a plan says of projectors and cameras that were planned together."""

from planning.model.document.joint_records import DeviceCount, JointRecord
from planning.model.plan import RigPlan
from planning.model.words import count_words, labelled, percent

_FOUND = {
    "two stages": "",
    "candidates": ", found over the candidates",
    "poses": ", found by moving all devices with one left out",
}


def joint_lines(plan: RigPlan) -> list[str]:
    """Return what planning together saved, and what is proved, a line each."""
    record = plan.document.joint
    if record is None:
        return []
    return labelled(
        "JOINT", [saved_words(plan, record), bound_words(plan, record), _slack(record)]
    )


def joint_words(plan: RigPlan) -> tuple[str, str] | None:
    """Return a label, and in few words what was saved and what is proved of it."""
    record = plan.document.joint
    if record is None:
        return None
    least = "in cost" if _costed(plan) else "of both together"
    if record.status == "optimal":
        proof = f"{record.needed:g} {least} are claimed the least of the candidates"
    else:
        proof = f"at least {record.lower_bound:g} {least} of the candidates are needed"
    return "JOINT", f"{saved_words(plan, record)}; {proof}"


def saved_words(plan: RigPlan, record: JointRecord) -> str:
    """Return what the plan takes, and what one kind after the other took."""
    before, after = record.two_stage, record.joint
    if (before.projectors, before.cameras) == (after.projectors, after.cameras):
        than = "fewer or cheaper than projectors first, then cameras"
        return f"none {than}: {_devices(plan, after)}"
    return (
        f"{_devices(plan, after)} instead of {_devices(plan, before)} of projectors "
        f"first, then cameras{_FOUND[record.found]}"
    )


def bound_words(plan: RigPlan, record: JointRecord) -> str:
    """Return what is proved of both numbers together, and over what."""
    over, unit = record.over, "in cost" if _costed(plan) else "devices"
    scope = (
        f"of {over.projectors} projectors and {over.cameras} cameras on offer, for "
        f"{over.samples} samples"
    )
    if record.status == "optimal":
        return f"{record.needed:g} {unit} are claimed the least {scope}"
    return (
        f"at least {record.lower_bound:g} {unit} are needed, {record.needed:g} suffice "
        f"{scope}"
    )


def _slack(record: JointRecord) -> str:
    before, after = (
        "none" if slack is None else percent(slack)
        for slack in (record.margin_before, record.margin)
    )
    return (
        f"the required share is measured within {after} of each limit or more "
        f"({before} before both kinds were moved together)"
    )


def _devices(plan: RigPlan, count: DeviceCount) -> str:
    cost = f" for {count.cost:g}" if _costed(plan) else ""
    return (
        f"{count_words(count.projectors, 'projector')} and "
        f"{count_words(count.cameras, 'camera')}{cost}"
    )


def _costed(plan: RigPlan) -> bool:
    """Whether the rig states what devices cost."""
    return plan.document.rig.projector.cost is not None
