"""The whole check: a sound plan passes, a rig that differs fails with a cause."""

import re
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from support.plain_shapes import box
from support.reconstruction_rigs import changed, reconstruct_plan

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.verify.reconstruction.check.accuracy import (
    measure_accuracy,
    nearest_distance,
    shown_inside,
)
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.patterns.ring_patterns import Frames
from planning.verify.reconstruction.render import rendered as rendered_module

KEYS = {
    "n_points",
    "n_merged",
    "redundant_fraction",
    "accuracy_rms_m",
    "accuracy_p95_m",
    "accuracy_bias_m",
    "completeness",
    "predicted_missing",
    "pixel_noise",
    "ambient",
    "passed",
    "failures",
}


@pytest.fixture(scope="module")
def ball() -> TriangleMesh:
    return sphere(0.04, subdivisions=5)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(rigs, ball, request) -> RigPlan:
    return rigs.small_rig(ball, request.param)


@pytest.fixture(scope="module")
def one_light(rigs, ball) -> RigPlan:
    return rigs.small_rig(ball, "diverging")


@pytest.fixture(scope="module")
def samples(ball):
    return sample_surface(ball, 8000, seed=5)


@pytest.fixture(scope="module")
def check(rigs, plan, samples) -> Reconstruction:
    predicted = rigs.predict_on_sphere(plan, samples)
    assert predicted.mean() > 0.3
    options = {"samples": samples, "predicted": predicted}
    return reconstruct_plan(plan, seed=0, threads=2, **options)


def test_a_sound_plan_passes(check):
    document = check.to_document()
    assert document["failures"] == []
    assert document["passed"] is True
    assert document.keys() >= KEYS
    assert document["accuracy_rms_m"] < 0.06e-3
    assert document["accuracy_p95_m"] < 0.12e-3
    assert abs(document["accuracy_bias_m"]) < 0.01e-3
    assert document["predicted_missing"] < 0.005
    half, one, two = document["completeness"]
    assert (half["threshold_m"], one["threshold_m"]) == (1.75e-3, 3.5e-3)
    assert half["fraction"] <= one["fraction"] <= two["fraction"] <= 1.0
    assert one["fraction"] > 0.98


def test_few_points_are_wildly_off(check):
    error = np.abs(check.accuracy.distances)
    assert np.mean(error > 0.3e-3) < 4e-3
    assert np.mean(error > 1e-3) < 1e-3
    assert error.max() < 2e-3


def test_redundancy_goes_and_completeness_stays(check, samples):
    assert 0.1 < check.redundant_fraction < 0.5
    assert 0.0 <= check.step_fraction < 0.1
    assert check.n_merged == len(check.merged.cloud) < check.n_points
    before, after = (
        np.mean(nearest_distance(cloud, samples, 0.01) <= 3.5e-3)
        for cloud in (check.everything, check.merged.cloud)
    )
    assert before - after < 0.004


def test_normals_and_sigma_of_the_merged_cloud_are_those_of_the_sphere(check):
    cloud, normals = check.merged.cloud, check.merged.normals
    known = np.isfinite(normals[:, 0])
    outward = cloud.points / np.linalg.norm(cloud.points, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", normals, outward)[known]
    assert known.mean() > 0.95
    assert np.quantile(cosine, 0.05) > np.cos(np.deg2rad(12.0))
    ratio = np.abs(check.accuracy.distances) / check.merged.sigma
    assert 0.5 < np.nanmedian(ratio) / 0.6745 < 1.6
    # By deciles of sigma, but where an edge may lie anywhere between two rings.
    sure = np.isfinite(ratio) & (cloud.noise_px < 0.5)
    order = np.argsort(check.merged.sigma[sure])
    for part in np.array_split(ratio[sure][order], 10):
        assert 0.75 < np.sqrt(np.mean(part**2)) < 1.4
    everything = check.to_document()
    assert 0.0 < everything["left_out_fraction"] < 0.5
    assert everything["beyond_1mm_fraction"] < 1e-3


def test_merged_points_are_better_than_either_projectors(check, ball):
    cloud, away = check.everything, measure_accuracy(check.everything, ball).distances
    parts = [np.sqrt(np.mean(away[cloud.projector == p] ** 2)) for p in (0, 1)]
    assert check.accuracy.rms_m < 0.75 * min(parts)
    assert check.accuracy.p95_m < 0.75 * np.percentile(np.abs(away), 95.0)


@pytest.mark.long
def test_the_result_does_not_depend_on_threads(rigs, plan, samples, check):
    predicted = rigs.predict_on_sphere(plan, samples)
    options = {"samples": samples, "predicted": predicted}
    one, two = reconstruct_plan(plan, seed=0, threads=1, **options), check
    assert one.to_document() == two.to_document()
    assert np.array_equal(one.everything.points, two.everything.points)
    assert np.array_equal(one.merged.sigma, two.merged.sigma, equal_nan=True)


@pytest.mark.long
def test_another_seed_is_another_noise(plan, check):
    other = reconstruct_plan(plan, seed=1)
    assert other.to_document() != check.to_document()
    assert other.accuracy.rms_m == pytest.approx(check.accuracy.rms_m, rel=0.2)
    assert other.passed
    assert other.to_document()["predicted_missing"] is None


def move_camera(document: dict[str, Any]) -> None:
    document["cameras"][1]["world_from_device"][0][3] += 2e-3


def swap_cameras(document: dict[str, Any]) -> None:
    first, second = document["cameras"][:2]
    first["id"], second["id"] = second["id"], first["id"]


def zoom_camera(document: dict[str, Any]) -> None:
    for i in range(2):
        document["cameras"][2]["K"][i][i] *= 1.02


def aim_projector_aside(document: dict[str, Any]) -> None:
    entry = document["projectors"][1]
    old = np.array(entry["world_from_device"])
    aside = 0.05 * old[:3, 0]
    new = look_at(old[:3, 3], aside, np.array([0.0, 0.0, 1.0]))
    entry["world_from_device"] = new.tolist()


def drop_projector(document: dict[str, Any]) -> None:
    del document["projectors"][1]


FAULTS = {
    "camera moved": (
        move_camera,
        r"C2 looks as if it stood (1\.9|2(\.[01].?)?) mm from its place",
    ),
    "cameras swapped": (swap_cameras, r"C1 and C2 look swapped"),
    "focal length off": (
        zoom_camera,
        r"C3 looks as if its focal length were 2 % longer",
    ),
    "projector aimed aside": (
        aim_projector_aside,
        r"P2 looks as if it were turned by at least 2\.9 degrees "
        r"\(aimed (49|5[01]) mm off",
    ),
    "projector off": (drop_projector, r"P2 is dark: no camera saw its light"),
}


@pytest.mark.long
@pytest.mark.parametrize("fault", FAULTS)
def test_a_rig_that_is_not_the_plan_fails(rigs, one_light, samples, fault):
    change, cause = FAULTS[fault]
    predicted = rigs.predict_on_sphere(one_light, samples)
    result = reconstruct_plan(
        one_light,
        seed=0,
        truth=changed(one_light, change),
        samples=samples,
        predicted=predicted,
    )
    assert not result.passed
    assert result.to_document()["passed"] is False
    text = " | ".join(result.failures)
    assert "limit" in text
    assert re.search(cause, text), text


@pytest.mark.long
@pytest.mark.parametrize("scale", [1.01, 0.99])
def test_an_object_one_per_cent_off_in_size_fails(
    rigs, one_light, samples, ball, scale
):
    other = TriangleMesh(scale * ball.vertices, ball.faces)
    predicted = rigs.predict_on_sphere(one_light, samples)
    result = reconstruct_plan(
        one_light,
        seed=0,
        truth=changed(one_light, lambda document: None, other),
        samples=samples,
        predicted=predicted,
    )
    bias = 0.04 * (scale - 1.0)
    assert not result.passed
    assert result.accuracy.bias_m == pytest.approx(bias, rel=0.1)
    assert any(f"distance is {1e3 * bias:.1f}"[:-1] in text for text in result.failures)
    assert len(result.failures) == 3
    larger = "larger" if scale > 1.0 else "smaller"
    words = rf"the object looks (1|0\.99|1\.01) % {larger}"
    assert re.search(words, result.failures[0])


def test_two_equal_cameras_have_noise_of_their_own(rigs, one_light):
    def twin(document: dict[str, Any]) -> None:
        document["cameras"] = [document["cameras"][0], dict(document["cameras"][0])]
        document["cameras"][1]["id"] = "C2"

    cloud = reconstruct_plan(changed(one_light, twin), seed=0).everything
    first, second = (cloud.points[cloud.camera == c] for c in (0, 1))
    shared = {tuple(point) for point in first} & {tuple(point) for point in second}
    assert len(first) > 1000
    assert len(shared) < 0.01 * len(first)


def test_samples_outside_the_target_are_left_aside(rigs, one_light, samples, ball):
    """Claims about the back would fail, but the target is the front."""
    front = ball.face_centroids[:, 1] < 0.0
    document = one_light.to_document()
    document["requirements"]["target"] = "dominant"
    surface = replace(one_light.surface, region=np.where(front, 0, -1))
    claimed = rigs.predict_on_sphere(one_light, samples) | (samples.normals[:, 1] > 0.8)
    result = reconstruct_plan(
        RigPlan.from_document(document, surface),
        seed=0,
        samples=samples,
        predicted=claimed,
    )
    assert result.passed, result.failures
    assert len(result.completeness.missing) == np.count_nonzero(front[samples.faces])


def test_a_claim_on_the_far_side_is_missed(one_light, samples):
    """Nobody looks at the back: what is predicted there is missing."""
    back = samples.normals[:, 1] > 0.8
    result = reconstruct_plan(one_light, seed=0, samples=samples, predicted=back)
    assert result.completeness.predicted_missing == 1.0
    assert np.array_equal(result.completeness.missing, back)
    assert len(result.failures) == 2
    assert "100.00 % of the samples predicted measured" in result.failures[1]


def test_completeness_counts_points_seen_from_the_samples_own_side(check, samples):
    """A thin shell: the same points with inner normals are nobody's measurement."""
    inner = type(samples)(
        samples.points, -samples.normals, samples.faces, samples.weight
    )
    outer = nearest_distance(check.merged.cloud, samples, 0.01) <= 3.5e-3
    assert outer.mean() > 0.3
    assert not np.any(nearest_distance(check.merged.cloud, inner, 0.01) <= 3.5e-3)


@pytest.mark.parametrize(("azimuth", "elevation"), [(-6.0, 5.0), (-8.0, 7.0)])
def test_faces_of_a_cube_in_grazing_light_cost_nothing_elsewhere(
    rigs, azimuth, elevation
):
    """Two faces are lit at about 85 degrees: too dim to read, and large."""
    cube = box((0.1, 0.1, 0.1), divisions=8)
    plan = rigs.plan_of(
        cube,
        [rigs.diverging("P1", rigs.direction(azimuth, elevation), cube.radius, 3.5e-3)],
        [rigs.camera("C1", rigs.direction(-42.0, 32.0))],
    )
    samples = sample_surface(cube, 4000, seed=5)
    predicted = rigs.predict_on_sphere(plan, samples)
    result = reconstruct_plan(plan, seed=0, samples=samples, predicted=predicted)
    assert predicted.mean() > 0.15
    assert result.passed, result.failures
    assert result.completeness.predicted_missing == 0.0
    assert result.completeness.fractions[1] > 0.99


def exchange_frames(monkeypatch, projector: str) -> None:
    """Let two bits of one projector change places in every camera's images."""
    render = rendered_module.render_pair

    def render_exchanged(seen, shown, *rest):
        frames = render(seen, shown, *rest)
        order = np.arange(len(frames.stack))
        if shown.design.id == projector:
            order[[6, 7, 8, 9]] = 8, 9, 6, 7
        return Frames(frames.stack[order], frames.corner)

    monkeypatch.setattr(rendered_module, "render_pair", render_exchanged)


def test_frames_out_of_order_are_named(rigs, one_light, samples, monkeypatch):
    exchange_frames(monkeypatch, "P1")
    predicted = rigs.predict_on_sphere(one_light, samples)
    result = reconstruct_plan(one_light, seed=0, samples=samples, predicted=predicted)
    assert not np.any(result.everything.projector == 0)
    assert not result.passed
    cause = r"P1 with C1, P1 with C2.*left out as `labels`.*frames out of order"
    first, *others = result.failures
    assert re.search(cause, first), first
    assert all(text.endswith("likely as above") for text in others), others


def test_a_cloud_that_is_empty_for_its_labels_says_so(rigs, ball, monkeypatch):
    exchange_frames(monkeypatch, "P1")
    alone = rigs.small_rig(ball, "diverging")
    alone = changed(alone, lambda document: document["projectors"].pop())
    result = reconstruct_plan(alone, seed=0)
    assert len(result.failures) == 1
    assert "no point was measured" in result.failures[0]
    assert "`labels`" in result.failures[0]


def test_nothing_to_see_is_a_failure_in_words(one_light):
    def blind(document: dict[str, Any]) -> None:
        document["projectors"] = []

    result = reconstruct_plan(one_light, seed=0, truth=changed(one_light, blind))
    assert result.failures == ("no point was measured: nothing was decoded",)
    assert result.to_document()["accuracy_rms_m"] is None
    assert result.redundant_fraction == 0.0


def test_predicted_must_fit_the_samples(one_light, samples):
    with pytest.raises(ValueError, match="for 8000 samples"):
        reconstruct_plan(
            one_light, seed=0, samples=samples, predicted=np.ones(3, dtype=bool)
        )


def test_progress_counts_every_pair(one_light):
    calls: list[tuple[int, int]] = []
    reconstruct_plan(one_light, seed=0, progress=lambda *step: calls.append(step))
    assert calls == [(n, 6) for n in range(7)]


def housed(document: dict[str, Any], owner: str, before: str) -> None:
    """Give a device a body half way between another one and the object."""
    every = {d["id"]: d for k in ("projectors", "cameras") for d in document[k]}
    halfway = 0.5 * np.array(every[before]["world_from_device"])[:3, 3]
    pose = np.array(every[owner]["world_from_device"])
    centre = pose[:3, :3].T @ (halfway - pose[:3, 3])
    every[owner]["body"] = {"centre_m": centre.tolist(), "half_m": [0.05, 0.05, 0.05]}


@pytest.mark.parametrize(
    ("owner", "before", "dark"),
    [("C2", "P1", {"C1", "C2"}), ("P1", "C1", {"C1"}), ("P1", "P1", set())],
)
def test_bodies_of_others_stop_light_and_views(rigs, owner, before, dark):
    ball = sphere(0.04, subdivisions=3)
    rig = rigs.small_rig(ball, focal=700.0)
    document = rig.to_document()
    document["projectors"] = document["projectors"][:1]
    document["cameras"] = document["cameras"][:2]
    housed(document, owner, before)
    found = reconstruct_plan(RigPlan.from_document(document, rig.surface), seed=0)
    points = {pair.camera: pair.n_points for pair in found.pairs}
    assert {name for name, n in points.items() if n == 0} == dark
    assert all(n > 200 for name, n in points.items() if name not in dark)


def test_a_pixel_that_shows_the_inside_of_an_open_mesh_is_told_by_itself(ball):
    """A bowl open towards one camera, and points put anywhere on the rays."""
    cut = ball.face_centroids[:, 1] > 0.2 * ball.radius
    bowl = TriangleMesh(ball.vertices, ball.faces[cut])
    before, behind = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])
    aims = bowl.face_centroids[::50]
    clouds = []
    for camera, centre in enumerate((before, behind)):
        rays = aims - centre
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        clouds.append(cloud_of(centre + 0.7 * rays, rays, camera))
    inside = shown_inside(Cloud.join(clouds), (before, behind), bowl)
    assert inside[: len(aims)].mean() > 0.95
    assert not inside[len(aims) :].any()


def cloud_of(points: np.ndarray, rays: np.ndarray, camera: int) -> Cloud:
    n = len(points)
    columns = {
        f.name: np.zeros((n, *getattr(Cloud.empty(), f.name).shape[1:]))
        for f in fields(Cloud)
    }
    columns |= {"points": points, "rays": rays, "camera": np.full(n, camera)}
    return Cloud(**columns)
