"""Which requirements a plan misses, why, and what would help."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from planning.model.document.certificates import Certificate
from planning.model.document.coverage_records import Coverage, Relaxation
from planning.model.document.family_records import FamilyCount, FamilyRecord
from planning.model.document.plan_document import PlanDocument
from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.model.words import area_words, percent
from planning.report.advice.accepted import accepting_all
from planning.report.advice.of_fronts import of_fronts
from planning.report.entries.survival_entries import falls_short_after
from planning.report.tolerance.survival_lines import (
    lit_words,
    measured_words,
    pairs_words,
)

from .cause_words import (
    areas_line,
    beside_these,
    causes_left,
    causes_line,
    inside_words,
    leaving_out_inside,
    rounded_down,
)
from .devices.device_lines import used_up
from .region_lines import floor_shortfalls


@dataclass(frozen=True)
class Shortfall:
    """A requirement that a plan misses.

    Attributes:
        figure: What is reached and what is asked, in a few words.
        missed: The same with the reason, as one or more sentences.
        helps: Changes of which each would help, the surest first.
        between: What stands between them.
    """

    figure: str
    missed: str
    helps: tuple[str, ...] = ()
    between: str = ", "

    def __str__(self) -> str:
        """Return all of it as one text."""
        if not self.helps:
            return self.missed
        return f"{self.missed} What would help: {self.between.join(self.helps)}"


def shortfalls(plan: RigPlan) -> tuple[str, ...]:
    """Return a text for each requirement that a plan misses."""
    return tuple(map(str, missing(plan)))


def missing(plan: RigPlan) -> Iterator[Shortfall]:
    """Yield the requirements that a plan misses, of a family member by member."""
    family, every = plan.document.family, list[Shortfall]()
    for name, member in plan.served:
        for one in _missing(member, family):
            figure, missed = f"{name}: {one.figure}", f"{name}: {one.missed}"
            every.append(replace(one, figure=figure, missed=missed))
    if not plan.members:
        every = list(_missing(plan))
    helps = of_fronts(plan.document, accepting_all([one.helps for one in every]))
    for one, texts in zip(every, helps, strict=True):
        yield replace(one, helps=texts)


def _missing(plan: RigPlan, family: FamilyRecord | None = None) -> Iterator[Shortfall]:
    required, check = plan.requirements, plan.document.reconstruction
    yield from _reachable(plan.document, required)
    yield from _covered(plan.document, required, family)
    yield from _floors(plan)
    yield from _surviving(plan)
    yield from _robust(plan.document, required)
    if check is not None and not check.passed:
        for failure in check.failures:
            first = failure.split(";")[0].split(". ")[0]
            yield Shortfall(f"check from pixels: {first}", failure)


def _floors(plan: RigPlan) -> Iterator[Shortfall]:
    for figure, missed, helps in floor_shortfalls(plan):
        yield Shortfall(figure, missed, helps, ", or ")


def _surviving(plan: RigPlan) -> Iterator[Shortfall]:
    """Whether what is left after each loss meets what is asked of all."""
    record, required = plan.document.survival, plan.requirements
    asked = required.survival
    if record is None or asked is None:
        return
    helps = tuple(
        f"--max-{kind}s {count.needed}"
        for kind in ("projector", "camera")
        if (count := getattr(record, f"{kind}s")) and count.needed > count.count
    )
    for loss in record.losses:
        dark, short = falls_short_after(loss, required)
        if not (dark or short):
            continue
        where = f"without {loss.lost}" if loss.lost else "with all devices there"
        by = f" by {pairs_words(asked.views)}" if asked.views > 1 else ""
        lit, measured = lit_words(plan, loss), measured_words(plan, loss)
        figure = f"{where} lit {lit} and measured{by} {measured} of what can be"
        regions = ", ".join(map(str, loss.floors_missed))
        floors = f"; region {regions} falls below its floor" if regions else ""
        yield Shortfall(
            figure,
            f"{figure}{floors}, {percent(required.dominant_coverage)} and "
            f"{percent(required.coverage)} are required after any loss (--survive, "
            f"--views).",
            helps,
        )


def _robust(document: PlanDocument, requirements: Requirements) -> Iterator[Shortfall]:
    """Whether enough rigs meet what is asked that aren't built exactly as planned."""
    found, robust = document.robust, requirements.robust
    if found is None or robust is None or found.n_met >= found.least:
        return
    met = f"{found.n_met} of {found.n_drawn} drawn rigs meet what is asked"
    yield Shortfall(
        f"{met}, {found.least} must",
        f"{met}, at least {found.least} must so that {percent(robust.quantile)} of all "
        f"do (--robust).",
        (
            "a better [calibration] or [mounting]",
            "a larger --accuracy",
            "more devices; `plan tolerance` says what matters most",
        ),
    )


def _reachable(
    document: PlanDocument, requirements: Requirements
) -> Iterator[Shortfall]:
    """Whether enough of the target, and of what is lit, is within reach."""
    coverage, least = document.coverage, requirements.min_reachable
    areas, unlit = coverage.target, coverage.unreachable_by_cause
    for kind, what, deed, reached, whole, why, relaxations in (
        (
            "projector",
            "the target",
            "lit",
            areas.reachable_by_projectors_m2,
            areas.area_m2,
            f" reached: {causes_line(unlit, areas.area_m2)}{inside_words(document)}",
            coverage.relaxations,
        ),
        (
            "camera",
            "the target" if requirements.pattern == "none" else "what is lit",
            "measured",
            areas.reachable_by_cameras_m2,
            areas.lit_m2,
            _unmeasurable(document),
            coverage.camera_relaxations,
        ),
    ):
        if reached >= least * whole:
            continue
        share = reached / whole
        others = leaving_out_inside(document) if kind == "projector" else ()
        reached_share = percent(share, asked=least)
        mount = requirements.workspace.mount_of(kind)
        stepped = mount is not None and mount.is_stepped
        yield Shortfall(
            f"{reached_share} of {what} can be {deed} at all, {percent(least)} asked",
            f"only {reached_share} of {what} can be {deed} from anywhere in the "
            f"workspace{' that mounts can be set to' * stepped}, {percent(least)} is "
            f"required (--min-reachable); "
            f"{area_words(whole - reached)} of {area_words(whole)} can't be{why}.",
            (*others, *_steps(relaxations, share, least)),
            "; ",
        )


def _steps(
    relaxations: tuple[Relaxation, ...], share: float, least: float
) -> tuple[str, ...]:
    """What each relaxation would reach, most first, and what accepts what there is."""
    ranked = sorted(relaxations, key=lambda step: -step.reachable_share)
    return (
        *(
            f"{step.change} would reach {percent(step.reachable_share, asked=least)}"
            for step in ranked
        ),
        f"--min-reachable {rounded_down(share)} accepts what there is",
    )


def _unmeasurable(document: PlanDocument) -> str:
    """Why what is lit can't be measured; of heads and turntables it isn't known."""
    if document.stations is not None:
        return (
            "; why, and what limit would help, isn't computed of heads and turntables"
        )
    causes = document.coverage.unmeasurable_by_cause
    return f": {areas_line(causes)}" if causes else ""


def _covered(
    document: PlanDocument, requirements: Requirements, family: FamilyRecord | None
) -> Iterator[Shortfall]:
    areas, proofs = document.coverage.target, document.certificates
    lit = "" if requirements.pattern == "none" else "lit and "
    for kind, proof, covered, whole, required, (deed, done) in (
        (
            "projectors",
            proofs.projectors,
            areas.lit_m2,
            areas.reachable_by_projectors_m2,
            requirements.dominant_coverage,
            ("light {} of the reachable target", "lit"),
        ),
        (
            "cameras",
            proofs.cameras,
            areas.measured_m2,
            areas.reachable_by_cameras_m2,
            requirements.coverage,
            (f"measure {{}} of what is {lit}measurable", "measured"),
        ),
    ):
        share = covered / whole if whole > 0 else 0.0
        if proof is None or share >= required:
            continue
        told = percent(share, asked=required)
        devices = kind if proof.count > 1 else kind.removesuffix("s")
        verb = deed if proof.count > 1 else deed.replace(" ", "s ", 1)
        yield Shortfall(
            f"{told} {done}, {100 * required:g} % asked",
            f"{proof.count} {devices} {verb.format(told)}, "
            f"{percent(required)} is required; {area_words(whole - covered)} of "
            f"{area_words(whole)} are left{_bodies(document.coverage, proof)}."
            f"{causes_left(kind, document)}",
            _remedies(kind, document, share, family),
        )


def _bodies(coverage: Coverage, proof: Certificate) -> str:
    """Bodies and obstacles that stand in the way of how much, the largest first."""
    blocked = {
        **{f"the body of {k}": v for k, v in coverage.blocked_by_body_m2.items()},
        **{f"obstacle {k!r}": v for k, v in coverage.blocked_by_obstacle_m2.items()},
    }
    phrases = [
        f"{1e6 * area:.0f} mm² blocked by {name}"
        for name, area in sorted(blocked.items(), key=lambda pair: -pair[1])
        if area > 0.0
    ]
    if proof.but_for_bodies:
        phrases.append(
            f"{proof.but_for_bodies} would do if their bodies didn't collide or "
            f"stand in each other's way"
        )
    return f" ({', '.join(phrases)})" if phrases else ""


def _remedies(
    kind: str, document: PlanDocument, share: float, family: FamilyRecord | None
) -> tuple[str, ...]:
    proof: Certificate = getattr(document.certificates, kind)
    needed, requirements = proof.needed, document.requirements
    # What a member takes alone needn't do for all.
    of_all: FamilyCount | None = None if family is None else getattr(family, kind)
    enough = needed.count if of_all is None else of_all.needed
    allowed = getattr(requirements, f"max_{kind}")
    option = "dominant-coverage" if kind == "projectors" else "coverage"
    accept = f"--{option} {rounded_down(share)} accepts this plan"
    if document.evaluation is not None:
        # A share of 0 is none that an option takes.
        more = beside_these(document, kind)
        return (more, f"or {accept}") if share > 0.0 else (more,)
    if gone := used_up(document, kind.removesuffix("s")):
        of_any = f"with any number of each {enough} would do"
        return (f"more of {gone} in stock: {of_any}", f"or {accept}")
    told = document.stations
    count = None if told is None else told.count
    if count is not None and count.needed is None:
        return "smaller housings, or less clearance_mm, would help", f"or {accept}"
    if count is not None and (count.needed or 0) > count.count:
        return f"--max-heads {count.needed} would do", f"or {accept}"
    # Where bodies are in the way, more devices may be no help.
    in_vain = enough <= proof.but_for_bodies
    if allowed is None or enough <= allowed or in_vain:
        return (accept,)
    if of_all is not None:
        least = f"over candidates at least {of_all.lower_bound}"
        return f"--max-{kind} {enough} ({least})", f"or {accept}"
    bound = f"{proof.candidates.status} over the candidates"
    if needed.lower_bound != needed.count:
        bound = f"at least {needed.lower_bound} {bound}"
    option_of_count = f"--max-{kind} {needed.count} ({bound})"
    field = () if needed.wider_field is None else (needed.wider_field,)
    total = proof.candidates.for_total
    if total is not None and total <= allowed:
        field += (f"a lower --region-coverage (without floors at least {total})",)
    return (option_of_count, *needed.relaxations, *field, f"or {accept}")
