"""Tables of what a plan claims: areas, proofs, regions, more or fewer, check, cost."""

from collections.abc import Iterator

import numpy as np

from planning.model.document.certificates import Certificate
from planning.model.document.coverage_records import ProjectorMarginal
from planning.model.plan import RigPlan
from planning.model.words import area_words, percent
from planning.report.summary.cause_words import CAUSE_WORDS
from planning.report.summary.coverage_lines import area_rows, reach_asked, share_cell
from planning.report.summary.devices.station_lines import STATIONS
from planning.report.summary.region_lines import region_place

from .markup import table

_COSTS = {
    "t1: a frame of the scan, by pixel": "t1",
    "t2: pixels to points, by pixel": "t2",
    "t3: merging": "t3",
    "t4: planning projectors": "t4",
    "t5: planning cameras": "t5",
    "C, eq. (8)": "C",
    "C with the cameras of a greedy cover": "C_before",
    "C with rings that miss the object": "C_all_rings",
    "images that were rendered, no part of C": "render_s",
}


def claim_tables(plan: RigPlan) -> Iterator[str]:
    """Yield the tables of a plan's claims."""
    yield _coverage(plan)
    yield _causes(plan)
    yield _sigma(plan)
    yield _proofs(plan)
    yield _regions(plan)
    yield from _marginal(plan)
    yield _check(plan)
    yield _cost(plan)


def _coverage(plan: RigPlan) -> str:
    target, surface = plan.coverage.target, plan.coverage.surface
    rows = [
        [
            label,
            *(
                cell
                for areas in (target, surface)
                for area in (getattr(areas, key),)
                for cell in (
                    area_words(area),
                    share_cell(area, areas.area_m2, reach_asked(plan, key)),
                )
            ),
        ]
        for label, key in area_rows(plan).items()
    ]
    asked = plan.requirements
    for label, part, whole, least in (
        (
            *("lit / reachable by projectors", "lit_m2", "reachable_by_projectors_m2"),
            asked.dominant_coverage,
        ),
        (
            *("measured / reachable by cameras", "measured_m2"),
            *("reachable_by_cameras_m2", asked.coverage),
        ),
    ):
        cells = [
            share_cell(getattr(areas, part), getattr(areas, whole), least)
            for areas in (target, surface)
        ]
        rows.append([label, "", cells[0], "", cells[1]])
    kind = plan.requirements.target
    head = ("", f"target ({kind})", "of the target", "whole surface", "of the surface")
    note = f"From {plan.coverage.samples} fresh samples of the target."
    return table("Coverage, with every denominator", head, rows, note)


def _causes(plan: RigPlan) -> str:
    whole = plan.coverage.target.area_m2
    ranked = sorted(plan.coverage.uncovered_by_cause.items(), key=lambda row: -row[1])
    rows = [
        [cause, CAUSE_WORDS.get(cause, ""), area_words(area), share_cell(area, whole)]
        for cause, area in ranked
        if area > 0.0
    ]
    head = ("cause", "in words", "area", "of the target")
    return table("Target that isn't measured, by the limit that forbids it", head, rows)


def _sigma(plan: RigPlan) -> str:
    sigma = plan.coverage.sigma
    if sigma is None:
        return ""
    rows = [
        [f"term: {name}, rms", f"{1e3 * value:.4f}"]
        for name, value in sigma.terms_rms_m.items()
    ]
    rows += [["median", f"{1e3 * sigma.median_m:.4f}"]]
    rows += [["95th percentile", f"{1e3 * sigma.p95_m:.4f}"]]
    head = ("along the normal, of the target's best pairs", "[mm]")
    return table("Predicted standard deviation", head, rows)


def _proofs(plan: RigPlan) -> str:
    if plan.document.evaluation is not None:
        return ""
    proofs = plan.document.certificates
    named = [("cameras", proofs.cameras)]
    if proofs.projectors is not None:
        named = [("projectors", proofs.projectors), *named]
    head = ("devices", "planned", "status", "at least, of the candidates", "candidates")
    head += ("samples", "at least, over all poses", "status there", "greedy cover")
    head += ("one fewer covers at most", "required")
    note = (
        "Bounds speak of the required area and of the floors of regions, over the "
        "candidates or over every pose of the workspace; those of cameras with these "
        "projectors."
    )
    return table("Proofs", head, [_proof(kind, proof) for kind, proof in named], note)


def _proof(kind: str, proof: Certificate) -> list[str]:
    over, fewer = proof.continuous, proof.one_fewer
    blind = "" if over is None or over.occlusion else ", shadows left out"
    return [
        kind,
        str(proof.count),
        proof.status,
        f"{proof.candidates.lower_bound}, {proof.candidates.status}",
        str(proof.candidates.n_candidates),
        str(proof.n_samples),
        "" if over is None else str(over.lower_bound),
        "nothing proved" if over is None else over.status + blind,
        str(proof.greedy_count),
        "" if fewer is None else area_words(fewer.upper_bound_m2),
        area_words(proof.required_m2),
    ]


def _regions(plan: RigPlan) -> str:
    rows: list[list[str]] = []
    asked = plan.requirements.region_coverage
    for region in plan.document.regions:
        areas = region.coverage
        place = region_place(plan, region).removeprefix(", ")
        shares, by, floor = ["", "", "", ""], "", ""
        if areas is not None and areas.samples:
            shares = [
                share_cell(areas.reachable_by_projectors_m2, region.area_m2),
                share_cell(areas.lit_m2, areas.reachable_by_projectors_m2, asked),
                share_cell(areas.reachable_by_cameras_m2, areas.lit_m2),
                share_cell(areas.measured_m2, areas.reachable_by_cameras_m2, asked),
            ]
            by = " ".join((*region.lit_by, *areas.measured_by))
            floor = areas.floor or "none"
        cone = f"{np.degrees(region.cone_angle):.0f}"
        area = area_words(region.area_m2)
        rows.append([str(region.id), area, cone, *shares, floor, by, place])
    head = ("region", "area", "cone [deg]", "reachable", "lit of reachable")
    head += ("measurable of lit", "measured of measurable", "floor", "by", "where")
    return table("Dominant regions", head, rows)


def _marginal(plan: RigPlan) -> Iterator[str]:
    target, surface = plan.coverage.target.area_m2, plan.coverage.surface.area_m2
    floor = plan.requirements.region_coverage
    lit: list[list[str]] = []
    measured: list[list[str]] = []
    for row in plan.document.marginal:
        if isinstance(row, ProjectorMarginal):
            worst = row.worst_region
            share = row.worst_region_lit
            lit.append(
                [
                    _planned(row.n_projectors, len(plan.projectors)),
                    share_cell(row.lit_target_m2, target),
                    share_cell(row.lit_surface_m2, surface),
                    "" if worst is None else str(worst),
                    "" if share is None else percent(share, asked=floor),
                ]
            )
        else:
            measured.append(
                [
                    _planned(row.n_cameras, len(plan.cameras)),
                    share_cell(row.measured_target_m2, target),
                    share_cell(row.measured_surface_m2, surface),
                ]
            )
    head = ("projectors", "target lit", "surface lit", "worst region", "lit of it")
    if lit:
        yield table("One projector more or fewer", head, lit)
    head = ("cameras", "target measured", "surface measured")
    yield table("One camera more or fewer", head, measured)


def _planned(count: int, planned: int) -> str:
    return f"{count} (planned)" if count == planned else str(count)


def _check(plan: RigPlan) -> str:
    check = plan.document.reconstruction
    if check is None:
        return ""
    rows = [["points, before merging", str(check.n_points)]]
    rows += [["points, merged", str(check.n_merged)]]
    rows += [
        [f"within {1e3 * step.threshold_m:.1f} mm of a point", percent(step.fraction)]
        for step in check.completeness
    ]
    for words, share in (
        ("edges found that were left out", check.left_out_fraction),
        ("points off by more than 1 mm", check.beyond_1mm_fraction),
    ):
        if share is not None:
            rows.append([words, percent(share, decimals=3)])
    if check.confusion is not None:
        for words, pair in (
            ("surface measured, or not, as predicted", check.confusion.surface.floors),
            ("the same, had nothing been predicted", None),
        ):
            floors = check.confusion.surface.floors
            share = floors.trivial_agreement if pair is None else pair.agreement
            rows.append([words, percent(share)])
    bounced = check.interreflection
    note = bounced.warning() if bounced is not None else ""
    head = ("reconstructed from rendered pixels", "")
    return table("The check from pixels", head, rows, note and f"Warning: {note}.")


def _cost(plan: RigPlan) -> str:
    cost, stations = plan.document.cost, plan.document.stations
    rows = [["frames of a scan", str(cost.n_frames)]]
    if stations is not None and stations.move_s is not None:
        between = f"moves between {STATIONS[stations.kind]}s"
        rows += [[between, f"{stations.move_s:.1f} s"]]
    rows += [["pixels read", str(cost.pixels)]]
    for words, key in _COSTS.items():
        value = getattr(cost, key)
        if value is not None:
            rows.append([words, f"{value:.4g} s"])
    return table("Cost", ("term", "value"), rows)
