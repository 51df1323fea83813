"""What a run prints: the verdict first, and no more than a person reads."""

import io
import re
import shlex

import pytest
from rich.console import Console

from planning.cli.show_command import show_command
from planning.model.plan import RigPlan
from planning.report.live_bar import LiveBar
from planning.report.summary.brief import COLUMNS, MOST_LINES, brief
from planning.report.summary.sections import SECTIONS
from planning.report.summary.shortfall import missing, shortfalls

FILES = ["out/plan.json", "out/surface.npz", "out/rig.png", "out/patterns"]


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


def changed(plan, change):
    document = plan.to_document()
    change(document)
    return RigPlan.from_document(document, plan.surface)


def more_cameras(document):
    camera = document["cameras"][0]
    document["cameras"] = [camera | {"id": f"C{k + 1}"} for k in range(60)]


def short_of_light(document):
    areas = document["coverage"]["target"]
    areas["lit_m2"] = 0.5 * areas["reachable_by_projectors_m2"]


def dark_regions(document):
    for region in document["regions"]:
        region["coverage"] |= {"floor": "missed", "relaxations": ["A = 3"] * 9}


CHANGES = {
    "as it is": lambda _: None,
    "sixty cameras": more_cameras,
    "short of light": short_of_light,
    "dark regions": dark_regions,
    "cut": lambda document: document.update(truncated=True),
    "unchecked": lambda document: document.update(reconstruction=None),
    "nothing proved over all poses": lambda document: document["certificates"][
        "cameras"
    ].update(continuous=None),
}


@pytest.mark.parametrize("folder", ["out", "it's part 7", "-x"])
def test_the_commands_that_it_names_can_be_pasted(plan, folder):
    """A shell takes the folder as one word, and the command as no option."""
    end = " ".join(brief(plan, [f"{folder}/plan.json"], []).splitlines()[-2:])
    show, verify = map(shlex.split, re.findall(r"`(plan .+?)`(?= checks|: )", end))
    place = {"-x": "./-x"}.get(folder, folder)
    assert show == ["plan", "show", place, "--all"]
    assert verify == ["plan", "verify", place]


def test_a_target_of_less_than_a_percent_is_told_by_its_area(plan):
    def choose(document):
        chosen = {"kind": "faces", "source": None, "sha256": None, "n_faces": 1}
        chosen |= {"area_m2": 2e-6, "n_removed_by_repair": 0}
        document["surface"]["selection"] = chosen
        for which, area in (("target", 2e-6), ("surface", 1e-2)):
            document["coverage"][which]["area_m2"] = area

    text = " ".join(brief(changed(plan, choose), FILES, []).split())
    assert "target: the 2 mm² of the surface that you chose" in text


@pytest.mark.parametrize("what", CHANGES)
def test_it_is_short_and_begins_with_the_verdict(plan, what):
    one = changed(plan, CHANGES[what])
    missed = shortfalls(one)
    lines = brief(one, FILES, missed).splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= COLUMNS
    assert lines[0].startswith("NOT MET  " if missed else "OK       ")
    for device in (*one.projectors[:2], *one.cameras[: 2 * (what != "sixty cameras")]):
        assert any(line.startswith(f"{device.id} ") for line in lines)


def test_what_is_missed_is_told_with_what_was_asked_and_what_helps(plan):
    one = changed(plan, short_of_light)
    (light, *_) = missing(one)
    text = " ".join(brief(one, FILES, shortfalls(one)).split())
    assert light.figure.startswith("50.0 % lit, ")
    assert light.figure in text
    assert f"HELPS {light.helps[0].split(' (')[0]}" in text
    assert str(light) == shortfalls(one)[0]


def test_a_field_that_is_far_too_wide_is_told_to_the_end(plan):
    def tiny(document):
        document["rig"] |= {"standoff_m": 50.0, "name": "of a long name " * 9}

    text = " ".join(brief(changed(plan, tiny), FILES, ()).split())
    assert re.search(r"WARNING the object is .* mm, is its unit right\?", text)


@pytest.mark.parametrize("views", [1, 2])
def test_what_is_asked_of_two_pairs_is_told_of_two(plan, views):
    def counted(document):
        document["requirements"]["survival"] = {"views": views, "survive": 0}
        areas = {"lit_m2": 1.0, "reachable_by_projectors_m2": 1.0, "measured_m2": 0.5}
        loss = areas | {"lost": None, "reachable_by_cameras_m2": 1.0}
        count = {"count": 2, "needed": 2, "without": 1, "lower_bound": 2}
        counts = {"projectors": count, "cameras": count}
        document["survival"] = {"samples": 9, "losses": [loss]} | counts

    text = " ".join(brief(changed(plan, counted), FILES, ()).split())
    assert ("% by one pair, 50.0 % by 2 pairs (" in text) == (views == 2)


def test_devices_beyond_the_room_are_counted(plan):
    text = brief(changed(plan, more_cameras), FILES, ())
    told = sum(line[:1] in "PC" and line[1:2].isdigit() for line in text.splitlines())
    n = len(plan.projectors) + 60
    assert f"and {n - told} more: plan show" in text
    assert told >= 2


def test_a_run_that_was_cut_or_not_checked_says_so_first(plan):
    cut = changed(plan, lambda document: document.update(truncated=True))
    assert "TRUNCATED" in brief(cut, FILES, ()).splitlines()[0]
    bare = changed(plan, lambda document: document.update(reconstruction=None))
    assert "NOT CHECKED" in brief(bare, FILES, ()).splitlines()[0]


def test_what_only_the_run_knows_is_told_too(plan):
    line = "the check wasn't made: the time limit came first"
    assert brief(plan, FILES, (line,)).startswith(f"NOT MET  {line}")


def test_every_section_has_a_heading_and_a_sentence(plan, handmade, tmp_path, capsys):
    path = handmade.save(plan, tmp_path)
    names = [section.name for section in SECTIONS]
    asked = dict.fromkeys([*names, "cameras", "all", "as_json"], False)
    wanted = {"plan_file": path, "threads": 1}
    assert show_command(asked | wanted | {"all": True}) == 0
    every = capsys.readouterr().out
    for section in SECTIONS:
        told = section.told(plan) or [f"{section.name.upper()}: {section.says}"]
        assert told[0] == f"{section.name.upper()}: {section.says}"
        assert ("\n".join(told) in every) == bool(section.lines(plan))
    assert show_command(asked | wanted | {"proofs": True}) == 0
    assert capsys.readouterr().out.startswith("PROOFS: ")
    assert show_command(asked | wanted | {"family": True}) == 0
    assert capsys.readouterr().out == "FAMILY: the plan has nothing of it\n\n"


def test_a_bar_shows_stage_percent_and_time_and_is_gone_in_the_end():
    written = io.StringIO()
    bar = LiveBar(Console(file=written, force_terminal=True, width=100))
    for line in ("curvature and regions", "  14 regions", "projectors: candidates"):
        bar(line)
    bar("written to out, NOT CHECKED yet")
    for line in ("cameras: candidates", "check: audit", "pixels: pair 2 of 4, about 9"):
        bar(line)
    task = bar._progress.tasks[0]
    assert task.description.startswith("check: audit, about ")
    # What went before the check, and a quarter of it.
    assert task.completed == pytest.approx(2 + 10 + 28 + 21 / 4)
    bar.stop()
    assert "plan: written to out, NOT CHECKED yet" in written.getvalue()
