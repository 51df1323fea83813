"""The page in Debian's Chromium, without a network: everything that it offers works.

Left out where Chromium and its driver aren't installed. Folders of plans between colons
in REPORT_PLANS are opened as well.
"""

import dataclasses
import os
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support import browser
from support.handmade import tampered, unclaimed
from support.plain_shapes import box

from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.bodies import Obstacle
from planning.model.plan import RigPlan
from planning.report.page.layers import CAUSES
from planning.report.page.page import write_page
from planning.report.page.per_face import centroids
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import recompute

pytestmark = pytest.mark.skipif(
    bool(browser.missing()), reason=f"not installed: {browser.missing()}"
)

# A face that the surface shows to the viewer, and where it is on the canvas.
FACING = """
const {stage, surface, picking} = ringrig;
const to = stage.free.position;
for (const face of arguments[0]) {
  const at = surface.centroid(face);
  if (surface.normal(face).dot(to.clone().sub(at).normalize()) < 0.5) continue;
  const [x, y] = stage.spot(at);
  if (picking.at(x, y)?.face !== face) continue;
  const size = [stage.canvas.clientWidth, stage.canvas.clientHeight];
  return [face, Math.round(x - size[0] / 2), Math.round(y - size[1] / 2)];
}"""
SPOTS = """
const {stage, surface} = ringrig;
const w = stage.window;
return arguments[0].map((face) => {
  const [x, y] = stage.spot(surface.centroid(face)) ?? [NaN, NaN];
  return [(x - w.left) / w.wide, (y - w.top) / w.high];
});"""
# What the shaders drew at places of a device's image, and how far aside the point is.
DRAWN = """
const {stage, picking, surface} = ringrig;
const w = stage.window;
return arguments[0].map(([x, y]) => {
  const hit = picking.at(w.left + x * w.wide, w.top + y * w.high);
  return hit && [hit.face, ...hit.point.toArray()];
});"""


def with_obstacle() -> RigPlan:
    """A wall beside the object, a room, bodies, and cameras whose lenses distort."""
    plan = unclaimed()
    wall = box((0.02, 0.3, 0.3))
    mesh = TriangleMesh(wall.vertices + [0.2, 0.0, 0.5], wall.faces)

    def change(document):
        document["rig"]["obstacle"] = [
            {"name": "wall", "shape": "mesh", "centre_mm": [0.0, 0.0, 0.0]}
        ]
        room = {"name": "room", "centre_m": [0.0, 0.0, 0.0], "half_m": [1.5, 1.5, 1.5]}
        room["axes"] = np.eye(3).tolist()
        document["requirements"]["workspace"]["box"] = room
        for camera in document["cameras"]:
            camera["body"] = {"centre_m": [0, 0, -0.05], "half_m": [0.02, 0.02, 0.05]}
            # Up to 10 pixels of it.
            camera["distortion"] = [-8.0, 100.0, 0.1, -0.08, 0.0]

    surface = dataclasses.replace(plan.surface, obstacles=(Obstacle("wall", mesh),))
    return RigPlan(tampered(plan, change).document, surface)


PLANS = {
    "diverging": unclaimed,
    "parallel": lambda: unclaimed("parallel"),
    "obstacle": with_obstacle,
} | {
    folder: partial(RigPlan.load, Path(folder) / "plan.json")
    for folder in filter(None, os.environ.get("REPORT_PLANS", "").split(":"))
}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    with browser.browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture(scope="module", params=list(PLANS))
def shown(request, session, tmp_path_factory):
    plan = PLANS[request.param]()
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_page(plan, path, threads=1)
    session.open(path)
    yield plan, session
    assert session.log() == []


def text(page, element):
    return page.run("return document.getElementById(arguments[0]).innerText", element)


def test_it_opens_and_every_layer_switches(shown):
    plan, page = shown
    assert page.run("return document.querySelector('[role=alert]')") is None
    layers = page.run("return ringrig.facts.layers.map((l) => [l.id, l.label])")
    looks = set()
    for name, label in layers:
        page.choose("layer", name)
        assert label in text(page, "legend")
        looks.add(page.run("return ringrig.surface.colours.slice(0, 6000).join()"))
    # Uniform layers may look alike; those of a sphere under light don't.
    assert len(looks) >= len(layers) - 2
    switches = page.run(
        "const {scene} = ringrig.stage; const count = () => { let n = 0;"
        "scene.traverseVisible(() => n++); return n; };"
        "return [...document.querySelectorAll('input[type=checkbox]')].map((box) => {"
        "const had = [count(), ringrig.surface.uniforms.ringsOn.value]; box.click();"
        "const has = [count(), ringrig.surface.uniforms.ringsOn.value]; box.click();"
        "return [box.id, box.parentElement.hidden, had.join() !== has.join()]; });"
    )
    names = {name for name, _, _ in switches}
    assert {"show-frusta", "show-beams", "rings-P1", "rings-P2"} <= names
    for name, hidden, changed in switches:
        assert changed or hidden or name == "show-labels", name
    solids = [name for name, hidden, _ in switches if hidden]
    assert ("show-obstacles" in solids) == (not plan.surface.obstacles)


def test_a_click_names_the_limit_that_the_audit_names(shown):
    plan, page = shown
    samples = centroids(plan)
    audit = recompute(plan, samples, Shadow.of(plan, threads=1))
    page.choose("view", "object")
    page.run("document.getElementById('canvas').scrollIntoView({block: 'center'})")
    clicked = 0
    for cause in np.unique(audit.cause[audit.cause >= 0])[:4]:
        faces = np.flatnonzero(audit.cause == cause).tolist()
        found = page.run(FACING, faces)
        if found is None:
            continue
        clicked += 1
        page.click("#canvas", *found[1:])
        chosen = int(re.search(r"Triangle (\d+)", text(page, "triangle"))[1])
        verdict = text(page, "triangle-verdict")
        # A pixel beside the centroid may be of the next triangle.
        assert f"({CAUSES[audit.cause[chosen]]})" in verdict or (
            audit.cause[chosen] < 0 and "Measured by" in verdict
        )
        assert np.linalg.norm(samples.points[chosen] - samples.points[found[0]]) < 0.01
        told = text(page, "triangle-devices").split("\n")
        for device, line in zip((*plan.projectors, *plan.cameras), told, strict=True):
            assert line.startswith(device.id)
    assert clicked >= 2


def test_every_device_is_told_by_its_own_first_limit(shown):
    plan, page = shown
    audit = recompute(plan, centroids(plan), Shadow.of(plan, threads=1))
    causes = page.run("return ringrig.facts.causes.light")
    for face in range(0, len(plan.surface.mesh.faces), 97):
        page.run("ringrig.choose(arguments[0], ringrig.surface.centroid(0))", face)
        told = text(page, "triangle-devices").split("\n")
        for p, line in enumerate(told[: len(plan.projectors)]):
            steps = audit.light[p, face]
            assert ("lights it" if steps == len(causes) else causes[steps]) in line
            # Figures never contradict the audit: those of a limit kept aren't told.
            found = re.search(r"([\d.]+)° \(at (most|least) ([\d.]+)", line)
            if found and "just" not in line:
                value, limit = float(found[1]), float(found[3])
                assert value >= limit if found[2] == "most" else value <= limit


def test_a_device_s_view_is_its_own_image(shown):
    plan, page = shown
    faces = np.arange(0, len(plan.surface.mesh.faces), 61)
    points = plan.surface.mesh.face_centroids[faces]
    aside = plan.surface.mesh.corners[faces, 0] - points
    # Steps in which the page tells places; just inside of a corner are a hundred.
    step = np.ptp(plan.surface.mesh.bounds, axis=0).max() / 65535
    spare = 100.0 * step / np.linalg.norm(aside, axis=1, keepdims=True)
    points = np.stack([points, points + np.maximum(1.0 - spare, 0.0) * aside])
    normals = plan.surface.mesh.face_normals[faces]
    for device in (*plan.projectors, *plan.cameras):
        page.choose("view", device.id)
        spots = np.array(page.run(SPOTS, faces.tolist()), dtype=float)
        pose, optics = device.world_from_device, device.device
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        width, height = optics.resolution
        if hasattr(optics, "camera_matrix"):
            pixels = optics.project(local)
        else:
            pixels = local[..., :2] / optics.pixel_pitch_m
            pixels += 0.5 * (np.array([width, height]) - 1.0)
        shares = (pixels + 0.5) / [width, height]
        np.testing.assert_allclose(spots, shares[0], atol=2e-5)
        # And the shaders drew the face there, as far as just inside of its corner.
        facing = np.sum((pose[:3, 3] - points[1]) * normals, axis=1) > 0.2
        facing &= np.all((shares[1] > 0.0) & (shares[1] < 1.0), axis=1)
        drawn = page.run(DRAWN, shares[1].tolist())
        for k in np.flatnonzero(facing):
            found = np.array(drawn[k][1:])
            if (found - points[1, k]) @ pose[:3, 2] > -1e-4:
                assert drawn[k][0] == faces[k]
                np.testing.assert_allclose(found, points[1, k], atol=3.0 * step)
    page.choose("view", "all")


# The wheel over a place beside the object's middle, and how near it came to there.
WHEEL = """
const {stage, surface} = ringrig;
const {canvas, free} = stage;
const at = surface.centroid(0);
const far = () => free.position.distanceTo(at);
const before = [...stage.spot(at), far()];
const box = canvas.getBoundingClientRect();
for (let k = 0; k < arguments[0]; k++) {
  const [x, y] = stage.spot(at);
  const to = {clientX: box.left + x, clientY: box.top + y, deltaY: -240, bubbles: true};
  canvas.dispatchEvent(new WheelEvent("wheel", to));
}
const size = [canvas.clientWidth, canvas.clientHeight];
return [before, [...stage.spot(at), far()], size];"""


def test_the_wheel_goes_on_to_what_is_under_it(shown):
    _, page = shown
    page.choose("view", "object")
    page.choose("view", "all")
    before, after, size = page.run(WHEEL, 8)
    assert np.abs(np.subtract(before[:2], np.divide(size, 2))).max() > 20
    # The wheel tells whole pixels, from whole pixels.
    np.testing.assert_allclose(after[:2], before[:2], atol=8)
    assert after[2] < 0.3 * before[2]
    page.run("ringrig.stage.onHome()")


def test_the_sequence_steps_and_distances_are_measured(shown):
    plan, page = shown
    n = len(plan.projectors)
    for step in range(1, n + 1):
        page.run("document.getElementById('step-next').click()")
        assert f"Step {step} of {n}: P{step}" in text(page, "step-words")
        assert (
            page.run("return ringrig.surface.uniforms.ringsOn.value") == 1 << step - 1
        )
    page.run("document.getElementById('step-end').click()")
    assert "not stepping" in text(page, "step-words")
    page.run("document.getElementById('measure').click()")
    for face in (3, 500):
        page.run(
            "document.getElementById('face-number').value = arguments[0];"
            "document.getElementById('face-go').click()",
            face,
        )
    one, other = plan.surface.mesh.face_centroids[[3, 500]]
    told = float(text(page, "measure-words").split(" mm apart")[0])
    assert told == pytest.approx(1e3 * np.linalg.norm(one - other), abs=0.02)
    page.run("document.getElementById('measure').click()")


def test_keys_turn_the_view_and_the_page_turns_dark(shown):
    _, page = shown
    paper = "return getComputedStyle(document.body).backgroundColor"
    before = page.run(paper)
    page.run("document.getElementById('theme').click()")
    assert page.run(paper) != before
    turned = page.run(
        "const {stage} = ringrig; const was = stage.turn;"
        "stage.canvas.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}));"
        "return stage.turn - was;"
    )
    assert abs(turned) > 0.01
    # Whatever can be used has a name that is read aloud.
    nameless = page.run(
        "return [...document.querySelectorAll('button, select, input, canvas')].filter("
        "(e) => !(e.getAttribute('aria-label') || e.innerText || e.labels?.length)"
        ").map((e) => e.id)"
    )
    assert nameless == []
