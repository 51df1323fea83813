"""What an evaluated rig doesn't keep of where devices may stand, for a person."""

from planning.model.document.device_records import ViolationRecord
from planning.model.plan import RigPlan
from planning.model.words import labelled

_WORDS = {
    "standoff": "stands {by} mm {what} for the distances that the rig allows",
    "cone": "stands {by} mm outside the cone of positions",
    "floor": "stands {by} mm below the floor",
    "box": "stands {by} mm outside the room",
    "mounting": "stands {by} mm off {what}",
    "keep_out": "stands {by} mm inside the keep-out volume {what!r}",
    "range": "stands {by} mm {what} for any of the object to be in its range",
    "clearance": "stands {by} mm too near to {what}",
    "body": "touches or reaches into {what} with its housing",
}


def warning_lines(plan: RigPlan) -> list[str]:
    """Return a line for each limit that a device of an evaluated rig breaks."""
    found = warnings(plan)
    return ["", *labelled("WARNING", found)] if found else []


def warnings(plan: RigPlan) -> list[str]:
    """Return the sentences of these lines."""
    evaluation = plan.document.evaluation
    if evaluation is None:
        return []
    devices = (*plan.projectors, *plan.cameras)
    names = {device.id: device.existing for device in devices}

    def words(broken: ViolationRecord) -> str:
        by_mm = f"{1e3 * (broken.by_m or 0.0):.1f}"
        called = names[broken.device]
        name = f" ({called})" if called != broken.device else ""
        what = _WORDS[broken.limit].format(by=by_mm, what=broken.what)
        return f"{broken.device}{name} {what}"

    return [words(v) for v in evaluation.violations]
