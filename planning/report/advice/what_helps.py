"""What would help a plan that misses a requirement, written beside what it misses."""

from contextlib import AbstractContextManager
from typing import Any

from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.report.claims import Claims, Devices
from planning.report.partial_plan import PartialPlan

from .camera_relaxations import for_so_many, out_of_reach
from .relaxations import reachability_relaxations
from .wider_field import wider_field


def add_what_helps(
    document: dict[str, Any],
    draft: PartialPlan,
    devices: Devices,
    claims: Claims,
    clock: Stopwatch,
) -> None:
    """Add relaxations to a plan's document, where it misses what they relax.

    Args:
        document: The plan; changed.
        draft: What it was written from.
        devices: As written, with the reference sets.
        claims: Made for these devices.
        clock: Times it.
    """
    asked = draft.scene.requirements
    coverage, proofs = document["coverage"], document["certificates"]
    areas = coverage["target"]
    if falls_short(areas, "reachable_by_projectors_m2", "area_m2", asked.min_reachable):
        with _timed(clock):
            coverage["relaxations"] = reachability_relaxations(
                draft.scene, devices.reference_projectors, (draft.tilt, 0.0)
            )
    if _too_few(proofs["projectors"], asked.max_projectors):
        with _timed(clock):
            field = wider_field(draft.scene, draft.stage, asked.max_projectors)
        if field is not None:
            _add_to_needed(proofs, "projectors", {"wider_field": field})
    if falls_short(areas, "reachable_by_cameras_m2", "lit_m2", asked.min_reachable):
        with _timed(clock):
            out = out_of_reach(draft.scene, draft.order.rig, devices, claims)
        coverage["unmeasurable_by_cause"] = out.by_cause
        coverage["camera_relaxations"] = out.relaxations
    if _too_few(proofs["cameras"], asked.max_cameras):
        _add_for_so_many(proofs, draft, asked, clock)


def falls_short(areas: dict[str, float], part: str, whole: str, share: float) -> bool:
    """Return whether an area is less than a share of another."""
    return areas[part] < share * areas[whole]


def _add_for_so_many(
    proofs: dict[str, Any], draft: PartialPlan, asked: Requirements, clock: Stopwatch
) -> None:
    """What would let the cameras that are allowed be enough."""
    with _timed(clock):
        scene = draft.scene.among(draft.projectors)
        rig, count = draft.order.rig, asked.max_cameras or 0
        helps = for_so_many(scene, rig, draft.camera_stage, count)
    if helps:
        _add_to_needed(proofs, "cameras", {"relaxations": list(helps)})


def _too_few(proof: dict[str, Any], allowed: int | None) -> bool:
    return allowed is not None and proof["needed"]["count"] > allowed


def _add_to_needed(proofs: dict[str, Any], kind: str, entry: dict[str, Any]) -> None:
    proof = proofs[kind]
    proofs[kind] = proof | {"needed": proof["needed"] | entry}


def _timed(clock: Stopwatch) -> AbstractContextManager[None]:
    return clock.stage("relaxations", "what would help")
