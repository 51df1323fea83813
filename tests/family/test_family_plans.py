"""One rig for several meshes: plans whose counts are known, and what may be said."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from support.factories import FEW_CANDIDATES
from support.plain_shapes import grid

from geometry.mesh.mesh import TriangleMesh
from planning import RigPlan, load_rig, plan_rig, verify_plan
from planning.cli.declared.plan_checks import check_options
from planning.cli.lines.comparison import compared
from planning.cli.main import commands
from planning.cli.output_folder import exchanged
from planning.model.errors import InputError, PlanFileError
from planning.report.summary.proof_lines import proof_lines
from planning.report.summary.shortfall import shortfalls
from planning.steps.family.family_plan import family_plan, met, with_members
from planning.verify import family as family_audit
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import examine
from planning.verify.family import audit_family
from planning.verify.trust import OF_MEMBER

# Options of the command line that aren't given.
_NOTHING = dict.fromkeys(
    (
        *("ranges", "unit", "size_mm", "select", "weight", "target", "max_heads"),
        *("max_projectors", "max_cameras", "pattern", "ring_axis", "poses"),
    )
) | {"files": ()}


def plate(towards: int, away: float = 0.03) -> TriangleMesh:
    """A plate that faces along +y or -y, and stands off the origin to that side."""
    flat = grid(0.1, 0.1, divisions=(8, 8))
    x, z, _ = flat.vertices.T
    turned = np.column_stack([-towards * x, np.full(len(x), towards * away), z])
    return TriangleMesh(turned, flat.faces)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "few.toml"
    path.write_text(FEW_CANDIDATES)
    return load_rig(path)


@pytest.fixture(scope="module")
def few(with_little_work):
    with with_little_work():
        yield


def planned(rig, meshes, max_projectors=4, **asked):
    return plan_rig(
        meshes,
        rig,
        max_projectors=max_projectors,
        target="surface",
        check=False,
        on_miss="return",
        threads=1,
        **asked,
    )


@pytest.fixture(scope="module")
def both(rig, few):
    """Two plates back to back: no device measures both."""
    return planned(rig, [plate(1), plate(-1)])


@pytest.fixture(scope="module")
def kept(both, tmp_path_factory):
    path = tmp_path_factory.mktemp("both") / "plan.json"
    both.save(path)
    return path


@pytest.fixture(scope="module")
def wide(rig, few):
    """Of three members a wide one, which takes two projectors, is left out."""
    larger, smaller = grid(0.3, 0.3, divisions=(8, 8)), 0.8
    x, z, _ = larger.vertices.T
    front = np.column_stack([-x, np.full(len(x), 0.03), z])
    back = front * (smaller, -1.0, smaller)
    apart = TriangleMesh.joined(
        [TriangleMesh(front, larger.faces), TriangleMesh(back, larger.faces[:, ::-1])]
    )
    return planned(rig, [plate(1), apart, plate(1, 0.04)], family_quantile=0.6)


def test_plates_that_face_apart_take_twice_what_one_takes(both, rig, few):
    alone = plan_rig(
        plate(1), rig, max_projectors=4, target="surface", check=False, threads=1
    )
    assert (len(alone.projectors), len(alone.cameras)) == (1, 1)
    family = both.document.family
    assert (len(both.projectors), len(both.cameras)) == (2, 2)
    for told in (family.projectors, family.cameras):
        assert (told.lower_bound, told.needed, told.hardest.count) == (2, 2, 1)
        # Each alone proves no more than what it takes for itself.
        assert told.over_poses.lower_bound == 1


def test_what_helps_is_for_all_members_not_for_the_first(both):
    """Each alone takes one device and misses another share: all take two, and less."""
    shares, members = (0.8, 0.7), []
    for member, share in zip(both.members, shares, strict=True):
        target = member.coverage.target
        dark = target.changed(lit_m2=share * target.reachable_by_projectors_m2)
        coverage = member.coverage.changed(target=dark)
        asked = replace(member.requirements, max_projectors=1)
        changed = member.document.changed(coverage=coverage, requirements=asked)
        members.append(replace(member, document=changed))
    lines = shortfalls(replace(both, members=tuple(members)))
    assert len(lines) == 2
    for line in lines:
        assert "--dominant-coverage 0.70 accepts this plan" in line
        assert "--max-projectors 2 (over candidates at least 2)" in line


@pytest.mark.long
def test_a_member_that_is_short_of_devices_says_what_it_takes(rig, few):
    """One device can't serve plates back to back; the other member takes one."""
    said: list[str] = []
    pair = TriangleMesh.joined([plate(1), plate(-1, 0.04)])
    family = planned(rig, [pair, plate(1)], max_projectors=1, progress=said.append)
    told = family.document.family.projectors
    assert (told.count, told.needed, told.lower_bound) == (1, 2, 2)
    assert any("1 of" in line and "at least 2 are needed" in line for line in said)
    short, served = family.members
    proof = short.document.certificates.projectors
    assert (proof.status, proof.count) == ("infeasible", 1)
    assert (proof.needed.count, proof.needed.lower_bound, proof.alone) == (2, 2, 2)
    areas = short.coverage.target
    assert proof.best_area.value_m2 == pytest.approx(areas.lit_m2, rel=0.05)
    assert proof.best_area.upper_bound_m2 < proof.required_m2
    assert served.document.certificates.projectors.status == "optimal"
    # So much was claimed once: no more than there are.
    for plan in (family, _bounded(family, "projectors", lower_bound=1)):
        assert verify_plan(plan, check_pixels=False, threads=1).failures == ()


@pytest.mark.long
def test_members_say_that_bounds_leave_out_bodies_of_chosen_devices(few, tmp_path):
    path = tmp_path / "bodied.toml"
    body = "[camera.body]\nsize_mm = [60, 60, 120]\ncentre_mm = [0, 0, -61]\n"
    path.write_text(FEW_CANDIDATES + body)
    bodied = planned(load_rig(path), [plate(1), plate(-1)])
    for member in bodied.members:
        proofs = member.document.certificates
        assert "bodies of chosen devices" in proofs.cameras.bounds_leave_out
        assert proofs.projectors.bounds_leave_out == ""
        assert verify_plan(member, check_pixels=False, threads=1).failures == ()


def test_no_plate_is_in_the_way_of_the_other(both):
    for member in both.members:
        areas = member.coverage.target
        assert areas.measured_m2 > 0.95 * areas.area_m2


@pytest.mark.long
def test_the_share_of_members_that_is_asked_saves_devices(rig, few):
    three = [plate(1), plate(-1), plate(1, 0.04)]
    half = planned(rig, three, family_quantile=0.6, pattern="dense")
    family = half.document.family
    assert (len(half.projectors), len(half.cameras)) == (1, 1)
    assert family.n_asked == 2
    assert family.left_out == (1,)
    assert family.projectors.lower_bound == family.cameras.lower_bound == 1
    assert met(half.members[1]) == 0.0
    assert half.missed == ()
    # No pixel measures the one left out, and it says so itself.
    verified = verify_plan(half, threads=1)
    assert (verified.passed, verified.unmet) == (True, ())
    assert len(verified.members[1][1].missed) == 1


@pytest.fixture(scope="module")
def shut():
    """A plate, and behind it two that stand face to face: no light falls between."""
    flat = plate(1)
    moved = flat.vertices - (0.0, 0.03, 0.0)
    facing = TriangleMesh(moved + (0.0, 0.001, 0.0), flat.faces[:, ::-1])
    return TriangleMesh.joined([flat, TriangleMesh(moved, flat.faces), facing])


@pytest.mark.long
def test_a_member_that_no_light_reaches_is_left_out_before_one_that_costs(
    rig, few, shut
):
    """It costs no device, but none serves it."""
    family = planned(
        *(rig, [plate(1), plate(-1), shut]), family_quantile=0.6, pattern="dense"
    )
    assert family.document.family.left_out == (2,)
    assert (len(family.projectors), family.missed) == (2, ())
    verified = verify_plan(family, check_pixels=False, threads=1)
    assert (verified.failures, verified.unmet) == ((), ())


@pytest.mark.long
def test_the_worst_member_is_one_that_misses_something(rig, few, shut):
    family = planned(rig, [plate(1), shut], pattern="dense")
    assert family.document.family.worst == 1
    assert [line.split(":")[0] for line in family.missed] == ["member-2"]
    assert audit_family(family, _cases(family)) == ()
    best = _with_family(family, worst=0)
    words = "member 0 misses no requirement, members [1] do"
    assert any(words in line for line in audit_family(best, _cases(best)))


def _with_failed_check(plan):
    check = verify_plan(plan, threads=1).reconstruction.record()
    failed = check.changed(passed=False, failures=("too few points",))
    return RigPlan(plan.document.changed(reconstruction=failed), plan.surface)


@pytest.mark.long
def test_a_member_that_fails_its_check_is_left_out_if_enough_others_are_well(both):
    worst = both.document.family.worst
    best, members = 1 - worst, list(both.members)
    members[best] = _with_failed_check(members[best])
    half = _with_family(both, quantile=0.5, n_asked=1)
    for plan, left, shown, missed in ((half, (best,), worst, 0), (both, (), best, 1)):
        told = with_members(plan, members)
        family = told.document.family
        assert (family.left_out, family.worst) == (left, shown)
        assert len(shortfalls(told)) == missed
        false = audit_family(told, _cases(told))
        assert not any("worst" in line or "n_asked" in line for line in false)
    # None is, where they are more than may be left out.
    members[worst] = _with_failed_check(members[worst])
    assert with_members(half, members).document.family.left_out == ()


def test_a_family_is_compared_by_its_worst_member_and_says_of_how_many(both):
    rows = {row.what: row for row in compared(both, both.members[0])}
    assert (rows["members"].first, rows["members"].differs) == (
        "each of 2 members",
        True,
    )
    worst = both.document.family.worst
    assert both.document.own_mesh == both.document.meshes[worst]
    other = _with_family(both, worst=1 - worst).document
    assert other.own_mesh == both.document.meshes[1 - worst]


def test_what_bounds_a_family_is_of_all_members_wherever_it_is_told(both):
    """Each member alone takes one device, both take two."""
    rows = {row.what: row for row in compared(both, both.members[0])}
    for kind in ("projectors", "cameras"):
        told = rows[f"{kind}, at least: candidates"]
        assert (told.first, told.second) == ("2", "1")
        assert rows[f"{kind}, at least: all poses"].first == "1"
    first, *rest = filter(None, proof_lines(both))
    assert first.startswith("FAMILY   2 projectors; over candidates at least 2")
    assert rest[1].endswith("alone, the worst member")
    assert not any("FAMILY" in line for line in proof_lines(both.members[0]))


def test_members_have_the_same_rig_and_each_its_own_claims(both):
    for member in both.members:
        for mine, theirs in zip(member.cameras, both.cameras, strict=True):
            assert np.array_equal(mine.world_from_device, theirs.world_from_device)
        assert member.of_member
    assert both.members[0].coverage != both.members[1].coverage
    assert not both.of_member


def test_every_claim_holds_and_what_is_written_is_read(both, kept):
    again = RigPlan.load(kept)
    assert again.to_document() == both.to_document()
    found = verify_plan(again, check_pixels=False, threads=1)
    assert found.failures == ()
    assert not any(OF_MEMBER in line for line in found.trusted)


def test_a_member_may_be_verified_by_itself(kept):
    member = RigPlan.load(kept.parent / "members" / "member-2" / "plan.json")
    found = verify_plan(member, check_pixels=False, threads=1)
    assert found.failures == ()
    assert OF_MEMBER in found.trusted


@pytest.mark.long
def test_one_seed_one_plan_whatever_the_threads(rig, few):
    once, again = (
        plan_rig(
            [plate(1), plate(-1)],
            rig,
            max_projectors=4,
            target="surface",
            pattern="dense",
            check=False,
            threads=threads,
        )
        for threads in (1, 2)
    )
    assert again.digest == once.digest


def _with_family(plan, **changes):
    family = plan.document.family.changed(**changes)
    document = plan.document.changed(family=family)
    return RigPlan(document, plan.surface, plan.members)


def _bounded(plan, kind, **changes):
    told = getattr(plan.document.family, kind).changed(**changes)
    return _with_family(plan, **{kind: told})


def _moved(plan):
    """A member whose first camera stands elsewhere."""
    first, *others = plan.members
    record = first.document.cameras[0]
    pose = np.array(record.world_from_device)
    pose[0, 3] += 1e-3
    camera = record.changed(world_from_device=pose.tolist())
    cameras = (camera, *first.document.cameras[1:])
    moved = RigPlan(first.document.changed(cameras=cameras), first.surface)
    return RigPlan(plan.document, plan.surface, (moved, *others))


def _with_first_projector(plan, changed):
    """The first projector is another one, in all members alike."""

    def other(document):
        first, *others = document.projectors
        return document.changed(projectors=(changed(first), *others))

    members = tuple(RigPlan(other(m.document), m.surface) for m in plan.members)
    return RigPlan(other(plan.document), plan.surface, members)


def _with_a_ring_left_out(first):
    """A ring that lights the surface is called idle."""
    radii = list(first.ring_radii)
    gone = radii.pop(len(radii) // 2)
    rings = first.rings.changed(left_out=(gone,))
    return first.changed(ring_radii=tuple(radii), rings=rings)


def _with_closer_even_rings(first):
    """As many even rings are claimed as would stand closer than those shown."""
    return first.changed(rings=first.rings.changed(n_even=2 * first.rings.n_even))


def _cases(plan):
    return [examine(m, seed=0, threads=1, n_samples=1000) for m in plan.members]


def _better(plan):
    first, *others = plan.document.members
    areas = first.coverage.target.changed(lit_m2=2.0 * first.coverage.target.area_m2)
    told = first.changed(coverage=first.coverage.changed(target=areas))
    document = plan.document.changed(members=(told, *others))
    return RigPlan(document, plan.surface, plan.members)


FALSE = {
    "fewer asked": (lambda p: _with_family(p, n_asked=1), "n_asked"),
    "the best is the worst": (
        lambda p: _with_family(p, worst=1 - p.document.family.worst),
        "worst",
    ),
    "a served one is left out": (lambda p: _with_family(p, left_out=(0, 1)), "family"),
    "a bound raised": (lambda p: _bounded(p, "cameras", lower_bound=3), "lower_bound"),
    "a bound lowered": (lambda p: _bounded(p, "cameras", lower_bound=0), "lower_bound"),
    "more needed than are enough": (
        lambda p: _bounded(p, "cameras", needed=3, lower_bound=3),
        "lower_bound: 3 is more than 2, which are enough",
    ),
    "a bound over poses raised": (
        lambda p: _bounded(
            p,
            "projectors",
            over_poses=p.document.family.projectors.over_poses.changed(lower_bound=2),
        ),
        "over_poses",
    ),
    "another count": (lambda p: _bounded(p, "projectors", count=3), "count"),
    "another rig for one": (_moved, "projectors differ"),
    "better than it says itself": (_better, "members.0.coverage"),
}


def test_a_ring_that_lights_a_served_member_is_not_idle(both):
    """It may light one that needn't be served."""
    forged = _with_first_projector(both, _with_a_ring_left_out)
    cases = _cases(forged)
    lit = [bool(case.actual.lit_by[0].any()) for case in cases]
    (one,) = np.flatnonzero(lit)
    words = f"members.{one}.P1.rings.left_out: 1 rings light"
    assert any(words in line for line in audit_family(forged, cases))
    aside = _with_family(forged, left_out=(int(one),), worst=1 - int(one))
    mine = f"members.{one}.P1.rings.left_out"
    assert not any(mine in line for line in audit_family(aside, cases))
    assert not any("left_out: 1" in m for m in audit_plan(forged.members[one]).failures)


def test_centred_axes_are_in_the_middle_of_what_members_served_are_lit_of(
    wide, monkeypatch
):
    """Or of all, where one was left out after axes were chosen."""
    asked, cases = [], _cases(wide)
    axes = wide.document.ring_axes.changed(taken="centred")
    told = RigPlan(
        wide.document.changed(ring_axes=axes), wide.surface, members=wide.members
    )
    monkeypatch.setattr(
        family_audit, "audit_centred", lambda groups, _: asked.extend(groups)
    )
    audit_family(told, cases)
    assert [list(group) for group in asked] == [[cases[0], cases[2]], list(cases)]


def test_rings_are_spaced_for_those_served_and_may_be_wide_on_others(wide):
    """A few rings light it: it is larger, and rings beyond the others are left out."""
    assert wide.document.family.left_out == (1,)
    rings = wide.members[1].document.projectors[0].rings
    assert rings.left_out
    assert rings.gap_m[1] > 2.0 * wide.document.projectors[0].rings.gap_m[1]
    assert verify_plan(wide, check_pixels=False, threads=1).failures == ()
    forged = _with_first_projector(wide, _with_closer_even_rings)
    false = [line for line in audit_family(forged, _cases(forged)) if "n_even" in line]
    assert [line.split(":")[0] for line in false] == [
        f"members.{m}.P1.rings.n_even" for m in (0, 2)
    ]


@pytest.mark.long
@pytest.mark.parametrize("name", FALSE)
def test_what_is_false_of_a_family_is_found(both, name):
    change, words = FALSE[name]
    failures = verify_plan(change(both), check_pixels=False, threads=1).failures
    assert any(words in failure for failure in failures), failures


def test_a_member_that_is_another_plan_is_found(both, rig, few):
    other = planned(rig, [plate(1), plate(-1, 0.05)], pattern="dense")
    told = both.document.family
    names = [record.name for record in both.document.members]
    placed = [record.alignment for record in both.document.members]
    mixed = family_plan((both.members[0], other.members[1]), names, placed, told)
    failures = verify_plan(mixed, check_pixels=False, threads=1).failures
    assert any("members.1" in failure for failure in failures)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"select": [0]}, "selection"),
        ({"region_coverage": 0.5}, "region_coverage"),
        ({"robust": 0.9}, "robust"),
        ({"survive": 1}, "survive"),
        ({"joint": True}, "joint"),
        ({"views": 2}, "views"),
        ({"cameras_by": "paper"}, "paper"),
        ({"pattern": "none"}, "pattern"),
    ],
)
def test_what_is_of_one_mesh_is_refused(rig, asked, words):
    asked = {"max_projectors": 0 if asked.get("pattern") == "none" else 2} | asked
    with pytest.raises(InputError, match=words):
        plan_rig([plate(1), plate(-1)], rig, **asked)


def test_align_and_quantile_are_of_several(rig):
    for asked in ({"align": "icp"}, {"family_quantile": 0.5}):
        with pytest.raises(InputError, match="several meshes"):
            plan_rig(plate(1), rig, max_projectors=1, **asked)


def test_a_member_elsewhere_is_refused(kept, tmp_path):
    document = json.loads(kept.read_text())
    document["members"][0]["path"] = "../elsewhere/plan.json"
    (tmp_path / "plan.json").write_text(json.dumps(document))
    (tmp_path / "surface.npz").write_bytes((kept.parent / "surface.npz").read_bytes())
    with pytest.raises(PlanFileError, match="elsewhere"):
        RigPlan.load(tmp_path / "plan.json")


@pytest.fixture
def folder(tmp_path):
    parts = tmp_path / "parts"
    parts.mkdir()
    for name, towards in (("front", 1), ("back", -1)):
        mesh = plate(towards)
        lines = [f"v {x} {y} {z}" for x, y, z in 1e3 * mesh.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
        (parts / f"{name}.obj").write_text("\n".join(lines))
    (parts / "notes.txt").write_text("no mesh")
    (tmp_path / "few.toml").write_text(FEW_CANDIDATES)
    return tmp_path


def run(*words):
    return CliRunner().invoke(commands, [str(word) for word in words])


@pytest.mark.long
def test_a_folder_and_a_pattern_name_the_same_members(few, folder):
    out, given = folder / "out", "parts/*"
    whole = [{"meshes": (str(folder / one),), **_NOTHING} for one in ("parts", given)]
    for options in whole:
        check_options(options)
    assert whole[0]["meshes"] == whole[1]["meshes"]
    ended = run(
        *("--mesh", folder / given, "--max-projectors", 4, "--target", "surface"),
        *("--rig", folder / "few.toml", "--no-check", "--no-patterns", "-o", out),
        *("--pattern", "dense"),
    )
    assert ended.exit_code == 0, ended.stderr
    assert "each of 2 members" in ended.stdout
    plan = RigPlan.load(out / "plan.json")
    assert [record.name for record in plan.document.members] == ["back", "front"]
    page = (out / "report.html").read_text()
    assert 'href="members/front/report.html"' in page
    assert (out / "members" / "front" / "report.html").exists()
    shown = run("show", out, "--family")
    assert "back" in shown.stdout
    assert "2 cameras; over candidates at least 2" in shown.stdout


def test_a_report_links_members_pages_where_they_are(both, tmp_path):
    both.save(tmp_path / "plan.json")
    link = 'href="members/member-2/report.html"'
    elsewhere = tmp_path / "elsewhere.html"
    assert run("report", tmp_path, "-o", elsewhere).exit_code == 0
    assert link not in elsewhere.read_text()
    assert not list(tmp_path.glob("members/*/report.html"))
    ended = run("report", tmp_path, "--json")
    names = ["report.html", *(f"members/member-{m}/report.html" for m in (1, 2))]
    assert json.loads(ended.stdout)["files"] == [str(tmp_path / name) for name in names]
    assert link in (tmp_path / names[0]).read_text()
    assert "Members</caption>" not in (tmp_path / names[2]).read_text()
    mine = tmp_path / names[1]
    mine.write_text("mine")
    assert run("report", tmp_path).exit_code == 2
    assert mine.read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--mesh", "empty", "--max-projectors", 2), "no mesh there"),
        (("--mesh", "nothing*.obj", "--max-projectors", 2), "no mesh there"),
        (("--mesh", "parts", "--max-projectors", 2, "--size-mm", 100), "--size-mm"),
        (("--mesh", "parts", "--max-projectors", 2, "--select", "f"), "--select"),
        (("--mesh", "parts"), "--max-projectors"),
        (("evaluate", "--mesh", "parts", "--poses", "p.csv"), "of one mesh"),
    ],
)
def test_a_family_that_cant_be_is_one_line(folder, monkeypatch, words, told):
    monkeypatch.chdir(folder)
    (folder / "empty").mkdir()
    ended = run(*words)
    assert ended.exit_code in (2, 3)
    assert told in ended.stderr


def test_a_family_takes_the_place_of_another_and_no_strangers(both, kept, tmp_path):
    for turn in range(2):
        with exchanged(tmp_path) as fresh:
            both.save(fresh / "plan.json")
        plan = RigPlan.load(tmp_path / "plan.json")
        assert len(plan.members) == 2, turn
    with exchanged(tmp_path) as fresh:
        both.members[0].save(fresh / "plan.json")
    assert not (tmp_path / "members").exists()
    (tmp_path / "members").mkdir()
    (tmp_path / "members" / "mine.txt").write_text("a stranger's")
    with pytest.raises(FileExistsError, match="members"), exchanged(tmp_path):
        pass


def test_the_current_folder_may_hold_no_members(both, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with exchanged(tmp_path) as fresh:
        both.members[0].save(fresh / "plan.json")
    assert (tmp_path / "plan.json").exists()
    with exchanged(tmp_path) as fresh:
        both.save(fresh / "plan.json")
    assert len(RigPlan.load(tmp_path / "plan.json").members) == 2
