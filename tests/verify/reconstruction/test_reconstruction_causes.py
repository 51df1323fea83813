"""Failures that no displaced device explains: each is named for what it is."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.reconstruction_rigs import changed, reconstruct_plan, ringed

from geometry.mesh.sampling import sample_surface
from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    ProjectorCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import PairCount
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode import decode
from planning.verify.reconstruction.decode.decode import CAUSES, Decoded
from planning.verify.reconstruction.faults.causes import _dark
from planning.verify.reconstruction.faults.inaccurate import wrong_roots
from planning.verify.reconstruction.faults.measured_clouds import rejection
from planning.verify.reconstruction.faults.supposed import Supposed
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner

FOCAL = 1400.0


@pytest.fixture(scope="module")
def plan(rigs) -> RigPlan:
    return rigs.small_rig(sphere(0.04, subdivisions=4), focal=FOCAL)


@pytest.fixture(scope="module")
def claims(rigs, plan) -> dict[str, Any]:
    """What the rig is sure to measure; rings are 5 px apart at this focal length."""
    near = rigs.small_rig(plan.surface.mesh)
    samples = sample_surface(plan.surface.mesh, 3000, seed=5)
    return {"samples": samples, "predicted": rigs.predict_on_sphere(near, samples)}


def failures(plan: RigPlan, claims: dict[str, Any], truth: RigPlan | None = None):
    return reconstruct_plan(plan, seed=0, truth=truth, **claims).failures


def said_once(words: str, failures: tuple[str, ...]) -> bool:
    """Whether the first failure says why, and each other one that it is the same."""
    first, *others = failures
    again = [text for text in others if text.endswith("; likely as above")]
    repeated = [text for text in others if re.search(words, text)]
    return bool(re.search(words, first)) and again == others and not repeated


@pytest.mark.parametrize("promised", [0.0, 0.1])
def test_a_device_that_was_to_measure_nothing_is_not_called_dark(plan, promised):
    """P2 gave no edge; by the plan no camera was to see its light."""
    shares = np.array([[0.5, 0.5, 0.5], [promised, 0.0, 0.0]])
    expected = Expected(sample_surface(plan.surface.mesh, 10, seed=0), None, shares)
    counts = tuple(
        PairCount(p, c, 2000, 1000 if p == "P1" else 0, 900, {})
        for p in ("P1", "P2")
        for c in ("C1", "C2", "C3")
    )
    measured = SimpleNamespace(plan=plan, counts=counts, expected=expected)
    told = ["P2 is dark: no camera saw its light; off, covered, blocked or aimed"]
    assert [w.removesuffix(" elsewhere") for w in _dark(measured)] == told * (
        promised > 0.0
    )


@pytest.mark.long
def test_two_projectors_on_at_once_are_named(plan, claims):
    apart = Scanner.of(plan)
    together = replace(apart, groups=(frozenset({"P1", "P2"}),))
    expected = Expected(claims["samples"], claims["predicted"])
    found = reconstruct(apart, seed=0, truth=together, expected=expected).failures
    assert found
    words = (
        r"P1 saturates lit pixels, \d+ % in C\d.*: P2 lights them too, on at the same"
    )
    assert said_once(words, found), found
    # A plan that fires them together itself isn't rendered so: its images are apart.
    assert reconstruct(together, seed=0, expected=expected).failures == ()


@pytest.mark.long
def test_pixels_that_saturate_hide_no_fault_and_are_told_where_there_is_none(
    plan, claims, monkeypatch
):
    """An eighth of the lit pixels; their edges stay."""
    monkeypatch.setattr(decode, "SATURATED", 180.0)
    saturates = r"P1 saturates lit pixels, 1\d % in C1"

    def moved(document: dict[str, Any]) -> None:
        document["cameras"][1]["world_from_device"][0][3] += 2e-3

    found = failures(plan, claims, changed(plan, moved))
    assert said_once("C2 looks as if it", found), found
    assert not re.search(saturates, " ".join(found))
    everywhere = claims | {"predicted": np.ones_like(claims["predicted"])}
    assert said_once(saturates, failures(plan, everywhere))


@pytest.mark.long
def test_a_root_disc_of_another_camera_is_named(plan, claims, monkeypatch):
    draw = ProjectorCalibration.pattern_for

    def drawn(projector, camera):
        patterns = draw(projector, camera)
        if (projector.id, camera.id) != ("P1", "C2"):
            return patterns
        return replace(patterns, camera_in_ring=-patterns.camera_in_ring)

    monkeypatch.setattr(ProjectorCalibration, "pattern_for", drawn)
    found = failures(plan, claims)
    words = r"P1 with C2: \d+ % of the points took the wrong one of the two roots"
    assert found
    assert said_once(words, found), found


def test_only_a_point_whose_ray_meets_its_ring_on_the_mesh_has_a_wrong_root(plan):
    """Points 10 mm before the mesh: labelled with the ring there, and with another."""
    scanner = Scanner.of(plan)
    camera, projector = plan.cameras[0], plan.projectors[0]
    n = 80
    away = np.linspace(-0.01, 0.01, n)
    pixels = calibrate_camera(camera).project(
        np.column_stack([away, np.full(n, -0.039), away])
    )
    at, _ = Supposed.of(scanner).seen(0, pixels)
    design = calibrate_projector(projector)
    rho = np.hypot(*design.ring_plane(design.panel(at)[0]).T)
    rays = calibrate_camera(camera).rays(pixels)
    numbers = np.zeros(n)
    cloud = Cloud(
        points=at - 0.01 * rays,
        rays=rays,
        beams=rays,
        pixels=pixels,
        camera=np.zeros(n, np.int16),
        projector=np.zeros(n, np.int16),
        ring=np.arange(n, dtype=np.int16),
        conditioning=numbers,
        shift=rays,
        noise_px=numbers,
        blur_px=numbers,
        bias_px=numbers,
    )
    order = np.argsort(rho)
    words = "P1 with C1: 100 % of the points took the wrong one of the two roots"
    for shift, wrong in ((0.0, True), (2e-3, False)):
        drawn = ringed(scanner.projectors[0], rho[order] + shift)
        marked = replace(scanner, projectors=(drawn, *scanner.projectors[1:]))
        pair = replace(Decoded.nothing(), cloud=cloud.take(order))
        pair = replace(pair, cloud=replace(pair.cloud, ring=cloud.ring))
        found = wrong_roots(marked, [((0, 0), pair)])
        assert [sentence.startswith(words) for sentence in found] == [True] * wrong


def test_samples_where_the_roots_meet_are_said_to_be_left_out(plan, claims):
    """The ring axis through the object, |r.m| >= 0.35 asked: none where r.m = 0."""

    def one_pair(document: dict[str, Any]) -> None:
        del document["projectors"][1], document["cameras"][1:]
        document["requirements"]["triangulation"]["min_conditioning"] = 0.35
        entry = document["projectors"][0]
        entry["world_from_ring"] = entry["world_from_device"]

    blind = changed(plan, one_pair)
    samples = claims["samples"]
    ring, eye = blind.projectors[0].world_from_ring, blind.cameras[0].world_from_device
    local = (samples.points - ring[:3, 3]) @ ring[:3, :3]
    rays = samples.points - eye[:3, 3]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.hypot(local[:, 0], local[:, 1])
    tilt = across / local[:, 2]
    m = np.column_stack([local[:, :2] / across[:, None], -tilt])
    conditioning = np.einsum("ij,ij->i", rays @ ring[:3, :3], m)
    facing = np.einsum("ij,ij->i", rays, samples.normals) < -0.6
    light = samples.points - ring[:3, 3]
    facing &= np.einsum("ij,ij->i", light, samples.normals) < -0.5
    every = {"samples": samples, "predicted": facing & (np.abs(conditioning) < 0.1)}
    assert every["predicted"].sum() > 10
    found = failures(blind, every)
    assert found
    assert said_once("`conditioning`, the rays run along", found), found


def test_a_hidden_region_is_named_with_its_share(plan, claims):
    """Faces with x > 0.02 are region 7, which C3 sees best; and C3 is off."""
    mesh = plan.surface.mesh
    region = np.where(mesh.face_centroids[:, 0] > 0.02, 7, 0)
    marked = RigPlan.from_document(
        plan.to_document(), replace(plan.surface, region=region)
    )
    truth = changed(plan, lambda d: d["cameras"].pop(2))
    samples = claims["samples"]
    found = failures(marked, claims, truth)
    assert any("C3 is dark: it saw no light" in text for text in found), found
    shares = re.findall(r"([\d.]+) % of what is promised of region (\d)", found[-1])
    assert shares
    assert shares[0][1] == "7"
    inside = claims["predicted"] & (region[samples.faces] == 7)
    missing = reconstruct_plan(marked, seed=0, truth=truth, **claims)
    lost = missing.completeness.missing & inside
    assert float(shares[0][0]) == pytest.approx(
        100 * lost.sum() / inside.sum(), abs=0.1
    )


@pytest.mark.long
def test_where_no_light_falls_is_said(plan, claims):
    samples = claims["samples"]
    back = {"samples": samples, "predicted": samples.normals[:, 1] > 0.8}
    found = failures(plan, back)
    assert found
    assert said_once("no projector's light falls on most of them", found), found


@pytest.mark.long
def test_surface_met_at_grazing_incidence_is_said(plan, claims):
    """Between 80 and 88 degrees from the nearest projector, but within its beam."""
    samples = claims["samples"]
    best = np.full(len(samples), -1.0)
    for projector in plan.projectors:
        to = projector.world_from_device[:3, 3] - samples.points
        to /= np.linalg.norm(to, axis=1, keepdims=True)
        best = np.maximum(best, np.einsum("ij,ij->i", to, samples.normals))
    grazed = (best < np.cos(np.deg2rad(82.0))) & (best > np.cos(np.deg2rad(88.0)))
    grazed &= samples.normals[:, 1] > 0.0
    found = failures(plan, {"samples": samples, "predicted": grazed})
    assert found
    words = r"P\d meets them at 8\d degrees \(median\), at grazing incidence"
    assert said_once(words, found), found


def test_every_cause_of_the_decoder_has_words(plan):
    for cause in CAUSES:
        pair = PairCount("P1", "C1", 0, 10, 0, {cause: 4})
        assert f"4 of 10 edges left out as `{cause}`, " in rejection((pair,))
