"""What was proved of a plan, for a person."""

from planning.model.document.certificates import Certificate
from planning.model.document.input_records import SelectionRecord
from planning.model.plan import RigPlan
from planning.model.words import area_words, count_words, labelled, percent
from planning.report.tolerance.survival_lines import surviving_proofs
from planning.scene.lights import light_of

from .devices.station_lines import fewest_words
from .family_lines import family_bounds

_EXCLUDED = {
    "projector_beam": "lie outside the beam",
    "projector_range": "out of range",
    "projector_incidence": "beyond the incidence limit",
    "tangent_angle": "too near the steep direction",
    "pixel_distance": "lit too coarsely",
    "projector_occlusion": "in shadow",
    "projector_body": "behind a device's body",
    "blocked_by_obstacle": "behind an obstacle",
}


def proof_lines(plan: RigPlan) -> list[str]:
    """Return what was proved of both counts, and over what."""
    requirements, proofs = plan.requirements, plan.document.certificates
    if plan.document.evaluation is not None:
        return [
            "",
            "GIVEN    these devices as they stand: none was sought or moved, and "
            "nothing is proved of their number",
            f"         {_regions(plan)}",
        ]
    if proofs.projectors is None:
        views = requirements.min_views
        return [
            "",
            _proof(plan, "camera", requirements.coverage, "measure by pairs")
            + f" ({views} or more cameras to a sample)",
            _continuous(proofs.cameras, "position, aim and roll"),
            f"         {_regions(plan)}",
        ]
    if fewest := fewest_words(plan):
        return ["", *labelled("FEWEST", [fewest]), f"         {_regions(plan)}"]
    poses = light_of(plan.projectors[0].device).bounded_over
    # About others cameras may measure more.
    axes = "" if plan.document.ring_axes is None else " and their ring axes"
    return [
        "",
        *_of_family(plan),
        _proof(plan, "projector", requirements.dominant_coverage, "light"),
        _continuous(proofs.projectors, poses + _of_any(plan, "projector")),
        _proof(plan, "camera", requirements.coverage, "measure")
        + f" (given these projectors{axes})",
        _continuous(proofs.cameras, "position, aim and roll" + _of_any(plan, "camera")),
        *surviving_proofs(plan),
        *route_lines(proofs.cameras),
        f"         {_regions(plan)}",
        *_excluded(proofs.projectors),
    ]


def _of_family(plan: RigPlan) -> list[str]:
    """What bounds a family's rig: the rest is of its worst member, alone."""
    if plan.document.family is None:
        return []
    worst = plan.document.members[plan.document.family.worst].name
    below = f"below: what is proved of {worst} alone, the worst member"
    return labelled("FAMILY", [*family_bounds(plan), below])


def _of_any(plan: RigPlan, kind: str) -> str:
    """A bound over all poses knows no stock."""
    several = len(plan.document.rig.models(kind)) > 1
    return " of any number of each model" * several


def route_lines(proof: Certificate) -> list[str]:
    """Return how many cameras either route needs and which is taken, in a line."""
    routes = proof.routes
    if routes is None:
        return []
    names = {"cover": "the cover", "paper": "the paper's largest baselines"}
    counts = [
        f"{'none' if count is None else count} by {names[kind]}"
        for kind, count in (("cover", routes.cover), ("paper", routes.paper))
        if routes.asked in (kind, "both")
    ]
    line = f"ROUTES   cameras: {', '.join(counts)}"
    if routes.asked != "both":
        return [f"{line}; {routes.why}" if routes.asked == "paper" else line]
    return [f"{line}; taken {names[routes.taken]}: {routes.why}"]


def user_selection(plan: RigPlan) -> SelectionRecord | None:
    """Return `surface.selection` if the user made it; older plans have none."""
    selection = plan.document.surface.selection
    made = selection is not None and selection.kind in ("faces", "vertex_weight")
    return selection if made else None


def target_words(plan: RigPlan) -> str:
    """Return what is to be measured, and how all of it is asked for."""
    coverage = plan.coverage
    part = coverage.target.area_m2 / coverage.surface.area_m2
    small = area_words(coverage.target.area_m2)
    share = percent(part, decimals=0) if part >= 0.01 else small
    if user_selection(plan) is not None:
        return f"the {share} of the surface that you chose"
    if plan.requirements.target == "surface":
        return "the whole surface"
    if plan.requirements.target == "outside":
        if coverage.target.area_m2 > 0.9995 * coverage.surface.area_m2:
            return "the whole surface, of which nothing lies inside"
        return f"the {share} of the surface that lies outside"
    if coverage.target.area_m2 > 0.995 * coverage.surface.area_m2:
        return "the whole surface, as it is curved alike all over"
    return f"{share} of highest curvature (--target surface: all)"


def _regions(plan: RigPlan) -> str:
    """Return how many regions there are, and what chose their faces."""
    n, chosen = len(plan.document.regions), user_selection(plan)
    if chosen is None:
        if plan.requirements.target == "outside":
            return f"{count_words(n, 'region')} of the outside"
        return count_words(n, "dominant region")
    by = "highest weight" if chosen.kind == "vertex_weight" else "selection"
    source = f" by {chosen.source}" if chosen.source else ""
    removed = chosen.n_removed_by_repair
    gone = f" ({removed} chosen ones removed by repair)" if removed else ""
    regions = f"{count_words(n, 'region')} of your {by}{source}"
    return f"{regions}: {count_words(chosen.n_faces, 'face')}{gone}"


def _excluded(proof: Certificate) -> list[str]:
    """Return which limit of eq. (2) took how many pairs of pose and sample, in a line.

    A pair counts for the first limit that it fails, in the order in which they stand.
    """
    pairs = proof.n_samples * proof.candidates.n_candidates
    excluded = proof.excluded_pairs
    if not excluded or not pairs:
        return []
    shares = [
        f"{percent(excluded[cause] / pairs)} {words}"
        for cause, words in _EXCLUDED.items()
        if cause in excluded
    ]
    lit = percent(1.0 - sum(excluded.values()) / pairs)
    return [
        f"         of {pairs:,} pairs of pose and sample {', '.join(shares)}; "
        f"{lit} are lit"
    ]


def _proof(plan: RigPlan, kind: str, share: float, verb: str) -> str:
    proof: Certificate = getattr(plan.document.certificates, f"{kind}s")
    mount = plan.requirements.workspace.mount_of(kind)
    stepped = mount is not None and mount.is_stepped
    candidates, needed, count = proof.candidates, proof.needed, proof.count
    scope = (
        f"to {verb} {100 * share:g} % of what the {candidates.n_candidates} "
        f"candidate poses{' that mounts can be set to' * stepped} reach of "
        f"{proof.n_samples} samples{_floors(plan, proof)}{_given(proof)}"
    )
    name, held = f"{kind}s", candidates.status.upper()
    if needed.count > count:
        have = f"at least {needed.lower_bound} {name} are needed"
        enough = f"{needed.count} suffice"
        if needed.count <= proof.but_for_bodies:
            enough += " but for their bodies"
        return f"{held:<9}{have}, {enough}, {scope}"
    if proof.status == "optimal":
        are = "is" if count == 1 else "are"
        return f"{held:<9}{count_words(count, kind)} {are} the fewest {scope}"
    least = candidates.lower_bound
    return f"BOUND    {count} {name}; at least {least} are needed {scope}"


def _floors(plan: RigPlan, proof: Certificate) -> str:
    """Say that the count is for the floors of regions, too, and what these cost."""
    if not proof.floors:
        return ""
    share = 100 * plan.requirements.region_coverage
    least, total = proof.needed.lower_bound, proof.candidates.for_total
    without = f" (without these at least {total})"
    more = without if total not in (None, least) else ""
    return f" and {share:g} % of each of {count_words(proof.floors, 'region')}{more}"


def _given(proof: Certificate) -> str:
    return f", given {proof.given} existing" if proof.given else ""


def _continuous(proof: Certificate, poses: str) -> str:
    """Return what was proved over all poses of the workspace, in a line."""
    bound = proof.continuous
    if bound is None:
        return f"         nothing is proved over every {poses} in the workspace"
    scope = (
        f"over every {poses} in the workspace, for {bound.n_samples} samples"
        f"{_given(proof)}"
    )
    blind = "" if bound.occlusion else ", shadows left out"
    least = bound.lower_bound
    if least >= proof.needed.count:
        return f"PROVED   fewer are too few {scope}{blind}"
    return f"BOUND    at least {least} are needed {scope}{blind}"
