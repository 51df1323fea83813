"""Causes with their areas, and what is said beside them, for a person."""

import math

from planning.model.document.plan_document import PlanDocument
from planning.model.words import area_words, percent, shell_word
from planning.scene.limits.limit import causes
from planning.scene.limits.pair_limits import MEASURED_LIMITS
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS
from planning.scene.limits.view_pair_limits import VIEW_PAIR_LIMITS

# Causes that take less than this share of what is left aren't told.
_LEAST_SHARE = 0.01
# Of the unreachable area, what lies inside to be told how to leave it out.
_MOST = 0.5
CAUSE_WORDS = {
    limit.name: limit.words
    for limit in (*PROJECTOR_LIMITS, *MEASURED_LIMITS, *VIEW_PAIR_LIMITS)
}


def causes_line(areas: dict[str, float], whole: float, *, most: int = 3) -> str:
    """Return the largest causes with their share of an area, as one line."""
    ranked = sorted(areas.items(), key=lambda pair: -pair[1])[:most]
    return "; ".join(
        f"{percent(area / whole)} {CAUSE_WORDS.get(cause, cause)}"
        for cause, area in ranked
    )


def areas_line(areas: dict[str, float]) -> str:
    """Return causes with their areas, the largest first, but for next to none."""
    ranked = sorted(areas.items(), key=lambda pair: -pair[1])
    phrases = [pair for pair in ranked if pair[1] >= _LEAST_SHARE * sum(areas.values())]
    return "; ".join(
        f"{area_words(area)} {CAUSE_WORDS.get(c, c)}" for c, area in phrases
    )


def causes_left(kind: str, document: PlanDocument) -> str:
    """Say what keeps `projectors` or `cameras` from the target, as a sentence."""
    limits, lit = PROJECTOR_LIMITS, ""
    if kind == "cameras":
        limits = (*MEASURED_LIMITS, *VIEW_PAIR_LIMITS)
        lit = "" if document.requirements.pattern == "none" else "lit "
    areas = {
        cause: area
        for cause, area in document.coverage.uncovered_by_cause.items()
        if cause in causes(limits)
    }
    return f" Of the {lit}target: {areas_line(areas)}." if areas else ""


def rounded_down(share: float) -> str:
    """Return a share to hundredths, or to one digit: few options take a share of 0."""
    places = 2 if not 0.0 < share < 0.01 else -math.floor(math.log10(share))
    return f"{math.floor(10.0**places * share) / 10.0**places:.{places}f}"


def inside_words(document: PlanDocument) -> str:
    """Return how much of what can't be reached lies inside the body."""
    inside = document.coverage.unreachable_inside_m2
    if not inside > 0.0:
        return ""
    hollow = document.own_mesh.shell.kind == "hollow shell"
    where = "lies inside the hollow body" if hollow else "lies in cavities"
    return f"; {area_words(inside)} of it {where}"


def leaving_out_inside(document: PlanDocument) -> tuple[str, ...]:
    """Return what helps where most of what no projector reaches lies inside."""
    areas, inside = document.coverage.target, document.coverage.unreachable_inside_m2
    dark = areas.area_m2 - areas.reachable_by_projectors_m2
    if document.faces_chosen_by != "curvature" or inside <= _MOST * dark:
        return ()
    return ("--target outside leaves out all that lies inside",)


def beside_these(document: PlanDocument, kind: str) -> str:
    """Return what seeks more `projectors` or `cameras` than an evaluation's."""
    evaluation, allowed = document.evaluation, len(document.projectors)
    path = "" if evaluation is None else evaluation.path
    most = f" --max-projectors {allowed + (kind == 'projectors')}"
    most = "" if document.requirements.pattern == "none" else most
    return (
        f"`plan --fixed {shell_word(path)}{most}`, mesh and rig as here, keeps these "
        f"and seeks more {kind}"
    )
