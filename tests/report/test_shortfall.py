"""Each missed requirement: how much, why, and the smallest relaxation that helps."""

import re

import pytest

from planning.cli.lines.comparison import compared
from planning.model.document.check_records import ReconstructionRecord
from planning.model.plan import RigPlan
from planning.model.words import area_words, percent
from planning.report.page.claim_tables import claim_tables
from planning.report.summary.coverage_lines import area_cell, marginal_lines
from planning.report.summary.family_lines import _shares
from planning.report.summary.region_lines import region_table
from planning.report.summary.shortfall import shortfalls


@pytest.fixture
def plan(handmade):
    return handmade.build_plan()


def missed(plan, *, blocked=None, relaxations=(), pattern="rings", command=(), **areas):
    document = plan.to_document()
    document["command"] = [*command]
    document["coverage"]["relaxations"] = list(relaxations)
    if blocked is not None:
        document["coverage"]["blocked_by_body_m2"] = blocked
    target = document["coverage"]["target"]
    target |= {
        "area_m2": 1.0,
        "reachable_by_projectors_m2": 1.0,
        "lit_m2": 1.0,
        "reachable_by_cameras_m2": 1.0,
        "measured_m2": 1.0,
    }
    target |= areas
    document["coverage"]["unreachable_by_cause"] = {
        "projector_occlusion": 0.2,
        "projector_incidence": 0.05,
    }
    document["certificates"]["projectors"] |= {
        "count": 1,
        "needed": {"count": 5, "lower_bound": 4},
    }
    document["certificates"]["cameras"] |= {
        "count": 3,
        "needed": {"count": 3, "lower_bound": 3},
    }
    document["reconstruction"] = None
    document["requirements"] |= {
        "coverage": 0.95,
        "dominant_coverage": 0.9,
        "min_reachable": 0.9,
        "pattern": pattern,
    }
    if pattern == "none":
        document["certificates"]["projectors"] = None
    return shortfalls(RigPlan.from_document(document, plan.surface))


def test_nothing_is_missed_where_everything_is_covered(plan):
    assert missed(plan) == ()


def test_out_of_reach_says_how_much_why_and_what_helps(plan):
    (line,) = missed(plan, reachable_by_projectors_m2=0.75, lit_m2=0.75)
    for words in ("75.0 %", "20.0 % shadowed", "5.0 % met by the light", "2500.0 cm²"):
        assert words in line
    assert "--min-reachable 0.75" in line


def test_what_reaches_what_is_asked_is_told_first(plan):
    """Plan files list the least gain first, a summary shows two remedies at most."""
    steps = [("A", 0.78), ("B", 0.85), ("C", 0.93)]
    told = [{"change": c, "reachable_share": share} for c, share in steps]
    (line,) = missed(plan, relaxations=told, reachable_by_projectors_m2=0.75)
    changes = line.split("What would help: ")[1].split(" would reach")
    assert [words[-1] for words in changes[:3]] == ["C", "B", "A"]
    assert line.endswith("--min-reachable 0.75 accepts what there is")


def test_one_projector_short_of_light_names_how_many_would_do(plan):
    (line,) = missed(plan, lit_m2=0.4)
    assert line.startswith("1 projector lights 40.0 %")
    assert "--max-projectors 5 (at least 4 claimed over the candidates)" in line
    assert "--dominant-coverage 0.40" in line


def test_cameras_that_miss_by_a_hair_offer_the_share_they_reach(plan):
    (line,) = missed(plan, measured_m2=0.9399)
    assert line.startswith("3 cameras measure 93.9 %")
    assert "--coverage 0.93 accepts this plan" in line
    assert "--max-cameras" not in line


def test_a_point_of_a_front_is_told_another_point(plan):
    """`--take` says how many there are, and the front was made for what is asked."""
    taken = "plan", "face.obj", "--take", "1,1"
    (line,) = missed(plan, command=taken, lit_m2=0.4)
    n_cameras = len(plan.cameras)
    assert f"--take 5,{n_cameras} (at least 4 claimed" in line
    assert "--max-projectors" not in line
    accepts = "--dominant-coverage 0.40 accepts this plan if the front is made again"
    assert f"{accepts} with it" in line


def test_what_accepts_a_plan_that_misses_several_is_told_together(plan):
    """Each alone would leave the other missed."""
    told = missed(plan, lit_m2=0.4, measured_m2=0.939)
    together = "--dominant-coverage 0.40 --coverage 0.93 together accept this plan"
    assert len(told) == 2
    assert all(line.endswith(together) for line in told)


def test_without_light_nothing_is_said_to_be_lit(plan):
    (line,) = missed(plan, pattern="none", measured_m2=0.5)
    assert "measure 50.0 % of what is measurable, " in line
    assert "lit" not in line.replace("--", "")


@pytest.mark.parametrize(
    ("measured", "accepted"),
    [(0.0043, "0.004"), (0.00096, "0.0009"), (0.0101, "0.01"), (0.001, "0.001")],
)
def test_a_share_that_is_advised_is_one_that_the_option_takes(plan, measured, accepted):
    (line,) = missed(plan, measured_m2=measured)
    advised = line.split("--coverage ")[1].split(" ")[0]
    assert advised == accepted
    assert 0.0 < float(advised) <= measured


def test_a_share_that_is_missed_is_rounded_down(plan):
    """What falls short by less than the last digit doesn't look as if it passed."""
    (line,) = missed(plan, lit_m2=0.89981)
    assert line.startswith("1 projector lights 89.9 % ")
    (line,) = missed(plan, reachable_by_projectors_m2=0.89981, lit_m2=0.89)
    assert line.startswith("only 89.9 % of the target")
    assert percent(0.89981, asked=0.89) == "90.0 %"
    assert percent(0.03001, decimals=2, most=0.03) == "3.01 %"
    assert percent(0.02999, decimals=2, most=0.03) == "3.00 %"


TABLES = {
    "comparison": lambda plan: [row.first for row in compared(plan, plan)[12:]],
    "family": _shares,
    "regions": region_table,
    "one more or fewer": marginal_lines,
    "page": claim_tables,
}


@pytest.mark.parametrize("name", TABLES)
def test_no_table_rounds_up_what_a_sentence_rounds_down(plan, name):
    """0.004 % fall short of what is lit, measured and lit of each region."""
    document = plan.to_document()
    document["requirements"] |= {"dominant_coverage": 0.9, "coverage": 0.95}
    document["requirements"]["region_coverage"] = 0.5
    short = [(document["coverage"]["target"], 0.89996, 0.94996)]
    short += [(one["coverage"], 0.49996, 0.49996) for one in document["regions"]]
    for areas, lit, measured in short:
        areas["lit_m2"] = lit * areas["reachable_by_projectors_m2"]
        areas["measured_m2"] = measured * areas["reachable_by_cameras_m2"]
    for row in document["marginal"]:
        row |= {"worst_region_lit": 0.49996} if "n_projectors" in row else {}
    told = "".join(TABLES[name](RigPlan.from_document(document, plan.surface)))
    assert {"89.9 %", "94.9 %", "49.9 %"} & {*re.findall(r"\d+\.\d %", told)}
    assert not {"90.0 %", "95.0 %", "50.0 %"} & {*re.findall(r"\d+\.\d %", told)}


def test_bodies_that_are_in_the_way_are_named(plan):
    blocked = {"P1": 0.0, "C1": 2.5e-5, "C2": 4.1e-4}
    (line,) = missed(plan, blocked=blocked, lit_m2=0.4)
    words = "410 mm² blocked by the body of C2, 25 mm² blocked by the body of C1"
    assert f"are left ({words}). Of the target: " in line
    assert "P1" not in line
    assert missed(plan, blocked=blocked) == ()
    document = plan.to_document()
    proof = document["certificates"]["projectors"]
    proof |= {"count": 2, "needed": {"count": 3, "lower_bound": 3}}
    proof["but_for_bodies"] = 3
    document["requirements"]["dominant_coverage"] = 1.0
    target = document["coverage"]["target"]
    target["lit_m2"] = 0.5 * target["reachable_by_projectors_m2"]
    short = shortfalls(RigPlan.from_document(document, plan.surface))
    line = next(s for s in short if "2 projectors light" in s)
    assert "3 would do if their bodies didn't collide" in line
    assert "--max-projectors" not in line


def test_a_failed_check_lists_its_own_sentences(plan):
    check = ReconstructionRecord(
        n_points=0,
        n_merged=0,
        redundant_fraction=0.0,
        accuracy_rms_m=None,
        accuracy_p95_m=None,
        accuracy_bias_m=None,
        completeness=(),
        predicted_missing=0.0,
        pixel_noise=None,
        ambient=None,
        passed=False,
        failures=("rms too large",),
    )
    document = plan.document.changed(reconstruction=check)
    assert "rms too large" in shortfalls(RigPlan(document, plan.surface))


def test_areas_of_tiny_parts_are_told_in_square_millimetres():
    assert [area_words(area) for area in (2.5e-6, 9.9e-5, 1.2e-4)] == [
        "2.5 mm²",
        "99 mm²",
        "1.2 cm²",
    ]
    assert area_cell(3e-6, 4e-6).split() == ["3.0", "mm²", "75.0", "%"]
    assert area_cell(0.3, 0.4).split()[:2] == ["3000.0", "cm²"]
