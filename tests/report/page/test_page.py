"""`report.html`: what it carries is what the audit says, and nothing gets in or out."""

import base64
import hashlib
import json
import re
import time
import zlib
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.handmade import save, tampered, unclaimed

from planning.cli.main import commands
from planning.cli.plans.saved_plans import SavedPlans
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.report.page.outline import outlines
from planning.report.page.page import error_by_face, is_page, page_of, write_page
from planning.report.page.payload import NOTHING, Payload, add_mesh, quantised
from planning.report.page.per_face import centroids, per_face
from planning.report.page.wall_sheet import wall_sheet
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED, PAIR_CAUSES, SEEN
from planning.verify.audit.predicates.recompute import recompute

HOSTILE = "</script><img src=x onerror=alert(1)>.obj"
EMPTY = ("meta", "link", "input", "img", "br")


def unpacked(entries, text):
    """Undo `Payload`, written again from what its docstrings say."""
    raw = zlib.decompress(base64.b64decode(text), -15)
    arrays, at = {}, 0
    for entry in entries:
        n, width = entry["n"], entry["bytes"] + entry["delta"]
        columns = []
        for _ in range(entry["columns"]):
            planes = np.frombuffer(raw, np.uint8, n * width, at).reshape(width, n)
            at += n * width
            value = sum(p.astype(np.int64) << 8 * k for k, p in enumerate(planes))
            if entry["delta"]:
                value = np.cumsum(np.where(value % 2, -(value + 1) // 2, value // 2))
            columns.append(value)
        arrays[entry["name"]] = np.array(columns)
    assert at == len(raw)
    return arrays


class Elements(HTMLParser):
    """Elements of a page with their attributes, and the text in each of some."""

    def __init__(self, text):
        super().__init__()
        self.found, self.open, self.text = [], [], {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in self.open:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open:
            self.text.setdefault(self.open[-1], []).append(data)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request):
    return unclaimed(request.param)


@pytest.fixture(scope="module")
def page(plan):
    return page_of(plan, threads=1)


@pytest.fixture(scope="module")
def carried(page):
    """What the page tells the viewer, and its arrays."""
    facts, payload, _ = Elements(page).text["script"]
    facts = json.loads(facts)
    return facts, unpacked(facts["arrays"], payload)


def test_arrays_survive_the_way_into_the_page():
    rng = np.random.default_rng(1)
    wanted = {
        "bytes": (rng.integers(0, 256, (50, 3)).astype(np.uint8), False),
        "steps": (rng.integers(0, 256, 50).astype(np.uint8), True),
        "far": (rng.integers(0, 2**32, (50, 2)).astype(np.uint32), True),
        "pairs": (rng.integers(0, 2**16, 50).astype(np.uint16), False),
    }
    payload = Payload()
    for name, (values, delta) in wanted.items():
        payload.add(name, values, delta=delta)
    found = unpacked(payload.entries, payload.text())
    for name, (values, _) in wanted.items():
        np.testing.assert_array_equal(found[name].T.reshape(values.shape), values)


def test_codes_are_the_nearest_of_254_steps_and_nothing_is_255():
    codes = quantised(np.array([0.0, 1.0, 0.5, np.nan, 9.0]), 0.0, 1.0)
    assert codes.tolist() == [0, 254, 127, NOTHING, 254]


def test_a_flat_mesh_keeps_its_places():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
    payload = Payload()
    box = add_mesh(payload, "flat", corners, np.array([[0, 1, 2]]))
    found = unpacked(payload.entries, payload.text())
    places = found["flat.places"].T / 65535 * box["side"] + box["low"]
    np.testing.assert_allclose(places, corners, atol=1e-4)


def test_the_page_says_of_every_face_what_the_audit_says(plan, carried):
    facts, arrays = carried
    mesh, samples = plan.surface.mesh, centroids(plan)
    audit = recompute(plan, samples, Shadow.of(plan, threads=1))
    cause = np.where(audit.cause < 0, 255, audit.cause.astype(int))
    np.testing.assert_array_equal(arrays["layer.cause"][0], cause)
    counts = (audit.pairs == MEASURED).sum(axis=(0, 1))
    np.testing.assert_array_equal(arrays["layer.pairs"][0], counts)
    np.testing.assert_array_equal(arrays["light"], audit.light)
    assert 0 < counts.max()
    assert len(np.unique(cause)) >= 5
    # Shares of the legend are areas.
    about = {layer["id"]: layer for layer in facts["layers"]}
    measured = next(row for row in about["cause"]["classes"] if row["code"] == 255)
    share = mesh.face_areas[audit.measured].sum() / mesh.area
    assert measured["share"] == pytest.approx(share)
    # And the mesh is the surface, to a step of its box.
    places = arrays["mesh.places"].T / 65535 * facts["mesh"]["side"]
    np.testing.assert_allclose(
        places + facts["mesh"]["low"], mesh.vertices, atol=1e-5 * mesh.radius * 2
    )


def test_values_of_failing_pairs_are_beyond_the_limit(plan):
    # A limit that some of the pairs keep, and others don't.
    exact = per_face(plan, centroids(plan), threads=1)
    least = float(np.nanmedian(exact.sigma))
    limits = {"max_sigma_m": least}
    strict = tampered(plan, lambda d: d["requirements"]["triangulation"].update(limits))
    facts = per_face(strict, centroids(strict), threads=1)
    fails = facts.pairs == SEEN + PAIR_CAUSES.index("sigma")
    assert fails.any()
    assert np.all(facts.failing[fails] > least)
    assert np.all(np.isnan(facts.failing[facts.pairs == MEASURED]))
    assert np.nanmax(facts.sigma) <= least
    np.testing.assert_array_equal(facts.best >= 0, facts.n_pairs > 0)


def test_the_same_page_whatever_the_threads(plan, page):
    assert page_of(plan, threads=2) == page


def test_nothing_is_fetched_and_only_our_script_runs(page):
    elements = Elements(page).found
    for name, attributes in elements:
        assert not {"src", "action", "data", "style"} & set(attributes), name
        assert not any(key.startswith("on") for key in attributes)
        assert attributes.get("href", "#").startswith("#")
    policy = next(a["content"] for n, a in elements if "http-equiv" in a)
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert not re.search(r"url\(|@import", Elements(page).text["style"][0])
    script = Elements(page).text["script"][-1]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy


def test_names_from_files_stay_text():
    def rename(document):
        document["meshes"][0]["path"] = HOSTILE
        document["rig"]["name"] = HOSTILE
        document["cameras"][0] |= {"existing": True, "name": HOSTILE}

    plan = tampered(unclaimed(), rename)
    elements = Elements(page_of(plan, threads=1))
    names = [name for name, _ in elements.found]
    assert "img" not in names
    assert names.count("script") == 3
    told = json.loads(elements.text["script"][0])
    assert HOSTILE in {device["existing"] for device in told["devices"]}
    assert not elements.open


def test_verdict_and_tables_need_no_script(plan, page):
    def claim(measured):
        areas = {"area_m2": 1.0, "reachable_by_projectors_m2": 1.0, "lit_m2": 0.8}
        areas |= {"reachable_by_cameras_m2": 0.8, "measured_m2": measured}
        return tampered(plan, lambda d: d["coverage"].update(target=areas))

    def head(plan):
        return page_of(plan, threads=1).split('id="viewer"')[0]

    met, missed = head(claim(0.6)), head(claim(0.2))
    assert "Every requirement is met; NOT CHECKED" in met
    assert ">75.0 %<" in met
    assert "NOT MET" in missed
    assert ">25.0 %</td><td>NOT MET<" in missed
    elements = Elements(page)
    names = [name for name, _ in elements.found]
    assert names.count("table") == names.count("caption") >= 5
    assert all(
        "scope" in attributes for name, attributes in elements.found if name == "th"
    )
    for device in (*plan.projectors, *plan.cameras):
        x, y, z = 1e3 * device.world_from_device[:3, 3]
        row = f'<th scope="row">{device.id}</th>'
        row += "".join(f'<td class="n">{v + 0.0:.1f}</td>' for v in (x, y, z))
        assert row in page


def test_the_wall_sheet_has_the_distances_from_the_centre(plan):
    sheet = wall_sheet(plan)
    assert sheet.count("<svg") == 3
    centre = np.array(plan.requirements.workspace.centre)
    for device in (*plan.projectors, *plan.cameras):
        for value in 1e3 * (device.world_from_device[:3, 3] - centre):
            assert f">{device.id} {value + 0.0:+.0f}<" in sheet


@pytest.mark.parametrize("pieces", [16, 4000])
def test_outlines_are_those_of_what_triangles_cover(pieces):
    # Quadrilaterals between two circles, of many cells or of less than one.
    turn = np.linspace(0.0, 2.0 * np.pi, pieces + 1)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    inner, outer = 300.0 + 20.0 * rim, 300.0 + 21.0 * rim
    if pieces == 16:
        outer = 300.0 + 50.0 * rim
    halves = [inner[:-1], outer[:-1], outer[1:]], [inner[:-1], outer[1:], inner[1:]]
    triangles = np.concatenate([np.stack(half, axis=1) for half in halves])
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    curves = outlines(triangles.reshape(-1, 2), faces, sides)
    assert len(curves) == 2
    for curve, wanted in zip(sorted(curves, key=np.ptp), (inner, outer), strict=True):
        for axis in (0, 1):
            ends = [getattr(np, end)(curve[:, axis]) for end in ("min", "max")]
            wants = [getattr(np, end)(wanted[:, axis]) for end in ("min", "max")]
            np.testing.assert_allclose(ends, wants, atol=0.41)
        x, y = curve.T
        a, b = wanted[:-1].T
        area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
        want = abs(np.sum(a * np.roll(b, -1) - b * np.roll(a, -1)))
        # Within two cells of the border.
        length = np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum()
        assert abs(area - want) < 2.0 * 0.4 * length


def test_errors_are_means_of_the_points_on_each_face():
    found = error_by_face(np.array([2, 0, 2]), np.array([1.0, 5.0, 2.0]), 4)
    np.testing.assert_array_equal(found, [5.0, np.nan, 1.5, np.nan])


def test_the_bundle_is_of_the_sources_that_stand_there():
    sources = Path(__file__).resolve().parents[3] / "planning/report/page/viewer"
    digest = hashlib.sha256()
    for path in sorted(sources.iterdir()):
        if path.suffix in (".js", ".mjs", ".json"):
            digest.update(path.read_bytes())
    bundle = files("planning.report.page").joinpath("viewer.js").read_text()
    again = "npm install --no-package-lock && npm run build"
    assert digest.hexdigest() in bundle.split("\n")[0], f"stale; {again}"
    assert len(bundle) < 800_000
    assert "</script" not in bundle.lower()


def test_the_command_writes_the_page_and_spares_what_is_none(tmp_path, plan):
    saved = RigPlan.load(save(plan, tmp_path))
    mine = tmp_path / "report.html"
    mine.write_text("mine")

    def report(*words):
        words = ["report", str(tmp_path), "--threads", "1", *words]
        return CliRunner().invoke(commands, words)

    assert report().exit_code == 2
    assert mine.read_text() == "mine"
    other = tmp_path / "other.html"
    ended = report("-o", str(other))
    assert ended.exit_code == 0, ended.stderr
    assert other.read_text() == page_of(saved, threads=1)
    mine.unlink()
    assert report("--json").exit_code == 0
    assert is_page(mine)


def test_a_run_without_time_for_the_page_says_so(tmp_path, plan, monkeypatch):
    said = []
    saved = SavedPlans(tmp_path, said.append, patterns=False)
    slow = "planning.cli.plans.saved_plans.write_page"
    monkeypatch.setattr(slow, lambda *_, **__: time.sleep(20.0))
    saved.write_page(plan, Stopwatch(time_limit=0.01), 1)
    assert "plan report" in said[-1]
    assert not (tmp_path / "report.html").exists()
    write_page(plan, tmp_path / "report.html", threads=1)
    assert is_page(tmp_path / "report.html")
