"""Captured images: read by name, held against each other, never a wrong cloud."""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.rays.proximity import closest_points
from geometry.shapes.primitives import sphere
from planning.model.errors import CapturesError
from planning.model.plan import RigPlan
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.agreement import (
    AGREE_PX,
    Agreement,
)
from planning.verify.reconstruction.captures.captured import (
    reconstruct_captured,
    reconstruct_rendered,
)
from planning.verify.reconstruction.captures.captures import (
    CaptureFolder,
    whole_image,
)
from planning.verify.reconstruction.captures.confirm import _Judge
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.inspection import DarkError, inspect
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Spent, decode_rendered
from planning.verify.reconstruction.scanner import Scanner

# A point farther off than this is no noise: 20 times the rms of the good cloud.
WRONG_M = 5e-4


@pytest.fixture(scope="module", autouse=True)
def _without_causes():
    """Leave out the search for causes, which takes longer than all the rest here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "planning.verify.reconstruction.reconstruct.explained", lambda said, _: said
        )
        yield


def small_plan(rigs, light: str) -> RigPlan:
    """Two projectors and two cameras of 320 x 240 px before a waved ball of 10 cm.

    P1 has 32 annuli, so that any 5 bits are a ring; P2 has codes to spare.
    """
    make = rigs.diverging if light == "diverging" else rigs.parallel
    projectors = [
        make("P1", rigs.direction(-30.0, 5.0), 0.055, 6.2e-3),
        make("P2", rigs.direction(25.0, 15.0), 0.055, 5.5e-3),
    ]
    projectors[0]["ring_radii"] = projectors[0]["ring_radii"][:31]
    cameras = rigs.two_small_cameras()
    body = rigs.bumpy_sphere(0.05, subdivisions=4)
    plan = rigs.plan_of(body, projectors, cameras, check=rigs.CHECK | {"tau_m": 6.2e-3})
    return plan


def expected_of(plan: RigPlan) -> Expected:
    found = predict_measured(plan, seed=0, n_samples=4000, threads=1)
    inside = found.samples
    weight = float(inside.weights[0])
    samples = SurfaceSamples(inside.points, inside.normals, inside.faces, weight)
    return Expected(samples, found.measured, found.by_pair)


@dataclass(frozen=True, eq=False)
class InMemory(CaptureFolder):
    """Images of every pair that were never written."""

    stacks: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)

    def require(self) -> None:
        pass

    def read(self, p: int, c: int) -> np.ndarray:
        return self.stacks[p, c]

    def write(self, p: int, c: int, stack: np.ndarray) -> None:
        self.stacks[p, c] = stack


@dataclass(frozen=True, eq=False)
class Job:
    """A plan, what it should measure, its images, and the cloud that they give."""

    plan: RigPlan
    scanner: Scanner
    expected: Expected
    images: InMemory
    good: Reconstruction

    def after(
        self, change: Callable[[np.ndarray], np.ndarray], pair=(0, 0)
    ) -> Reconstruction:
        """Reconstruct with the images of one pair changed."""
        return self.of({pair: change(self.images.stacks[pair].copy())})

    def of(self, changed: dict[tuple[int, int], np.ndarray]) -> Reconstruction:
        images = InMemory(Path("x"), self.scanner, self.images.stacks | changed)
        return reconstruct_captured(images, self.expected, threads=1)

    def n_bits(self, p: int) -> int:
        return (len(self.images.stacks[p, 0]) - 4) // 2


def job_of(plan: RigPlan) -> Job:
    scanner, expected = Scanner.of(plan), expected_of(plan)
    images = InMemory(Path("x"), scanner)
    good = reconstruct_rendered(scanner, expected, seed=0, threads=1, save=images)
    return Job(plan, scanner, expected, images, good)


@pytest.fixture(scope="module")
def job(rigs) -> Job:
    return job_of(small_plan(rigs, "diverging"))


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def lit_job(request, rigs, job) -> Job:
    if request.param == "diverging":
        return job
    return job_of(small_plan(rigs, request.param))


@pytest.fixture(scope="module")
def saved(rigs, tmp_path_factory) -> tuple[RigPlan, Expected, CaptureFolder]:
    """Images of one projector and two cameras, in files."""
    plan = small_plan(rigs, "diverging")
    document = plan.document.changed(projectors=plan.document.projectors[:1])
    plan = RigPlan(document, plan.surface)
    expected = expected_of(plan)
    folder = CaptureFolder(
        tmp_path_factory.mktemp("saved") / "captures", Scanner.of(plan)
    )
    reconstruct_rendered(Scanner.of(plan), expected, seed=0, threads=1, save=folder)
    return plan, expected, folder


@pytest.fixture
def copied(saved, tmp_path) -> tuple[CaptureFolder, Expected]:
    """The same in a folder that may be spoiled."""
    plan, expected, folder = saved
    shutil.copytree(folder.path, tmp_path / "captures")
    return CaptureFolder(tmp_path / "captures", Scanner.of(plan)), expected


def assert_no_wrong_point(found: Reconstruction) -> None:
    if found.accuracy is not None:
        assert found.accuracy.max_m < WRONG_M


def assert_left_out(found: Reconstruction, pair: str, why: str) -> None:
    """A pair is gone and said to be; the others are as good as ever."""
    assert_no_wrong_point(found)
    assert not found.passed
    assert found.failures[0].startswith(f"{pair}: ")
    assert why in found.failures[0]
    points = {f"{one.projector} with {one.camera}": one.n_points for one in found.pairs}
    assert points.pop(pair) == 0
    assert min(points.values()) > 1000


def exchanged(n: int, *pairs: tuple[int, int]) -> np.ndarray:
    order = np.arange(n)
    for one, other in pairs:
        order[[one, other]] = order[[other, one]]
    return order


def test_good_images_give_a_good_cloud(lit_job):
    assert lit_job.good.failures == ()
    assert lit_job.good.accuracy.rms_m < 5e-5
    assert_no_wrong_point(lit_job.good)
    again = lit_job.of({})
    assert again.failures == ()
    assert np.array_equal(again.merged.cloud.points, lit_job.good.merged.cloud.points)
    assert np.array_equal(again.merged.sigma, lit_job.good.merged.sigma, equal_nan=True)
    assert again.photometry is None
    assert again.to_document()["pixel_noise"] is None


def test_white_and_black_exchanged(job):
    found = job.after(lambda s: s[exchanged(len(s), (0, 1))])
    assert_left_out(found, "P1 with C1", "white is darker than black")


@pytest.mark.long
@pytest.mark.parametrize("p", [0, 1])
def test_a_bit_or_root_disc_exchanged_with_its_inverse(job, p):
    for bit in range(job.n_bits(p) + 1):
        frames = 2 + 2 * bit, 3 + 2 * bit
        found = job.after(lambda s, f=frames: s[exchanged(len(s), f)], (p, 0))
        assert_left_out(found, f"P{p + 1} with C1", "left out")


@pytest.mark.long
@pytest.mark.parametrize("p", [0, 1])
def test_two_bits_or_a_bit_and_the_root_disc_exchanged(lit_job, p):
    root = lit_job.n_bits(p)
    neighbours = [(bit, bit + 1) for bit in range(root)]
    for one, other in [*neighbours[1::2], (0, root), (3, root), (root - 1, root)]:
        a, b = 2 + 2 * one, 2 + 2 * other
        found = lit_job.after(
            lambda s, a=a, b=b: s[exchanged(len(s), (a, b), (a + 1, b + 1))], (p, 0)
        )
        # Frames that are dark or bright all over may change places unnoticed.
        assert_no_wrong_point(found)


@pytest.mark.parametrize(("one", "other"), [(2, 4), (3, 4), (2, 5)])
def test_single_frames_exchanged_do_not_add_up(job, one, other):
    found = job.after(lambda s: s[exchanged(len(s), (one, other))])
    assert_left_out(found, "P1 with C1", "don't add up to white and black")
    assert "02-bit0" in found.failures[0]
    assert "04-bit1" in found.failures[0]
    assert "06-bit2" not in found.failures[0]


@pytest.mark.parametrize("gain", [0.96, 1.05])
def test_one_frame_of_another_exposure_is_named(job, gain):
    for frame, name in (
        (0, "00-white or 01-black"),
        (2, "02-bit0"),
        (3, "03-bit0-inv"),
    ):
        found = job.after(lambda s, k=frame: scaled(s, k, gain))
        assert_left_out(found, "P1 with C1", "than the other frames")
        assert name in found.failures[0]
        assert ("brighter" in found.failures[0]) == (gain > 1.0)
    assert job.after(lambda s: scaled(s, 4, 1.01)).passed


def scaled(stack: np.ndarray, frame: int, gain: float) -> np.ndarray:
    stack[frame] = np.clip(np.rint(gain * stack[frame]), 0, 255)
    return stack


@pytest.mark.parametrize(
    ("frames", "part"), [([0], 0.3), ([2], 1.0), ([5], 0.3), ([4, 5], 0.3)]
)
def test_a_frame_that_moved_is_found_to_a_third_of_a_pixel(job, frames, part):
    def moved(stack):
        there = np.roll(stack[frames], 1, axis=2).astype(float)
        stack[frames] = np.rint(part * there + (1.0 - part) * stack[frames])
        return stack

    found = job.after(moved, (1, 0))
    assert_left_out(found, "P2 with C1", " px against the others")


def test_over_exposed_images_lose_what_is_clipped(job):
    def brighter(gain):
        return lambda s: np.clip(np.rint(gain * s), 0, 255).astype(np.uint8)

    found = job.after(brighter(1.4), (1, 0))
    assert_no_wrong_point(found)
    assert "of the lit pixels are clipped and left out" in found.remarks[0]
    before, after = (r.pairs[1].lit_pixels for r in (job.good, found))
    assert 0.5 * before < after < 0.97 * before
    found = job.after(brighter(5.0), (1, 0))
    assert_left_out(found, "P2 with C1", "over-exposed")


def test_a_sensor_that_is_full_before_its_numbers_are(job):
    """Levels pile up at 150, far below 250."""
    found = job.after(lambda s: np.minimum(s, 150), (1, 0))
    assert_no_wrong_point(found)
    assert "of the lit pixels are clipped and left out" in found.remarks[0]
    before, after = (r.pairs[1].lit_pixels for r in (job.good, found))
    assert after < 0.9 * before


@pytest.mark.parametrize("level", [0, 255])
def test_a_frame_of_one_level(job, level):
    def flat(stack):
        stack[4] = level
        return stack

    found = job.after(flat)
    assert_left_out(found, "P1 with C1", "04-bit1")


def test_a_damaged_part_of_a_frame_is_left_out_and_the_rest_measured(job):
    def spoiled(stack):
        stack[4, 100:125, 130:160] = 0
        return stack

    found = job.after(spoiled)
    assert_no_wrong_point(found)
    assert "don't add up to white and black" in found.remarks[0]
    assert found.pairs[0].n_points > 1000


def test_white_that_is_dark_in_part_is_said(job):
    """Its pixels don't count as lit by white, but bits and inverses light them."""

    def cut(stack):
        stack[0, 120:] = 0
        return stack

    found = job.after(cut, (1, 0))
    assert_no_wrong_point(found)
    assert found.failures[0].startswith("P2 with C1: ")


def test_frames_of_one_image_are_named(job):
    def doubled(stack):
        stack[4:6] = stack[2:4]
        return stack

    found = job.after(doubled)
    assert_left_out(found, "P1 with C1", "02-bit0 and 04-bit1 are the same image")


@pytest.mark.parametrize(
    "curve",
    [
        lambda light: light ** (1 / 2.2),
        lambda light: light**1.6,
        lambda light: 0.3 * light + 0.7 * light * light * (3.0 - 2.0 * light),
        lambda light: np.log1p(20.0 * light) / np.log1p(20.0),
    ],
)
def test_any_rising_tone_curve_moves_no_edge(job, curve):
    found = job.after(
        lambda stack: np.rint(255.0 * curve(stack / 255.0)).astype(np.uint8)
    )
    assert_no_wrong_point(found)
    assert found.failures == ()
    assert any("made that good" in text for text in found.remarks)
    good = pair_clouds(job)[0, 0]
    own = found.everything.take(
        (found.everything.projector == 0) & (found.everything.camera == 0)
    )
    apart, nearest = KDTree(good.pixels).query(own.pixels)
    near = apart < 0.5
    assert near.sum() > 0.9 * len(good)
    moved = own.pixels[near] - good.pixels[nearest[near]]
    assert np.abs(np.median(moved, axis=0)).max() < 0.002
    assert np.median(apart[near]) < 0.02


def test_a_curve_for_each_frame_is_refused(job):
    """Automatic contrast: no one curve mends what another does in each frame."""

    def each(stack):
        gammas = np.where(np.arange(len(stack)) % 4 < 2, 1.0, 1 / 2.2)[:, None, None]
        return np.rint(255.0 * (stack / 255.0) ** gammas).astype(np.uint8)

    found = job.after(each)
    assert found.pairs[0].n_points == 0
    assert any("P1 with C1" in text for text in found.failures)


def test_half_the_light_is_no_fault(job):
    found = job.after(lambda s: np.rint(0.5 * s).astype(np.uint8))
    assert found.failures == ()
    assert_no_wrong_point(found)


def pair_clouds(job: Job) -> dict[tuple[int, int], Cloud]:
    cloud = job.good.everything
    keys = [(p, c) for p in (0, 1) for c in (0, 1)]
    return {
        (p, c): cloud.take((cloud.projector == p) & (cloud.camera == c))
        for p, c in keys
    }


def test_slanted_surface_is_no_contradiction(lit_job):
    """Without the planes edges of these sound pairs seem to be 0.3 px off."""
    residuals = Agreement(lit_job.scanner, pair_clouds(lit_job)).residuals
    assert len(residuals) == 4
    assert max(residuals.values()) < 0.05


def test_what_noise_explains_is_no_contradiction(job):
    """Edges moved by as much as they are said to vary, and by more."""
    clouds, rng = pair_clouds(job), np.random.default_rng(1)
    noisy = clouds[0, 0]
    moved = rng.normal(0.0, 0.7, (len(noisy), 1)) * noisy.shift
    noisy = replace(noisy, points=noisy.points + moved)
    for stated, blamed in ((0.7, False), (0.02, True)):
        one = replace(noisy, noise_px=np.full(len(noisy), stated))
        judge = _Judge(job.scanner, Agreement(job.scanner, clouds | {(0, 0): one}))
        assert (judge.verdict((0, 0)) is not None) == blamed
        assert judge.on_mesh((0, 0)) != blamed


def test_noise_alone_is_no_light(job):
    """It brightens as many pixels as it darkens, and neither by chance alone."""
    rng, pattern = np.random.default_rng(2), job.scanner.projectors[0]
    names = job.scanner.frame_names(0, 0)
    stack = rng.normal(120.0, 5.0, (len(names), 120, 160)).round().astype(np.uint8)
    rings = pattern.pattern_for(job.scanner.cameras[0])
    for frames in (stack, stack[::-1]):
        bright = np.count_nonzero(frames[0].astype(int) - frames[1] >= 10)
        assert bright > 1000
        with pytest.raises(DarkError, match="no light"):
            inspect(frames, rings, names)


def test_mirrored_and_turned_images_are_confirmed_by_nothing(lit_job):
    for change in (lambda s: s[:, :, ::-1], lambda s: s[:, ::-1, ::-1]):
        found = lit_job.after(change)
        assert_left_out(found, "P1 with C1", "measured the same spots, edges are")


def test_images_of_two_cameras_exchanged_give_no_cloud(lit_job):
    stacks = lit_job.images.stacks
    found = lit_job.of({(p, c): stacks[p, 1 - c] for p in (0, 1) for c in (0, 1)})
    assert found.n_merged == 0
    assert len(found.failures) == 5
    assert "left out" in found.failures[0]
    assert all("images of other devices" in why for why in found.failures[:4])
    found = lit_job.of({(0, c): stacks[0, 1 - c] for c in (0, 1)})
    assert_no_wrong_point(found)
    assert [pair.n_points > 1000 for pair in found.pairs] == [False, True] * 2
    assert found.failures[0].startswith("P1 with C1: left out")
    assert found.failures[1].startswith("P1 with C2: left out")


def test_images_of_two_projectors_exchanged(job):
    """P2 has one bit more: its lower bits stand in for those of P1."""
    other = job.images.stacks[1, 0]
    order = [*range(12), len(other) - 2, len(other) - 1]
    assert_left_out(job.after(lambda s: other[order]), "P1 with C1", "left out")


def stood_there(job: Job, change, *, mesh=None) -> Reconstruction:
    """Images of a rig that isn't the plan, and of an object that perhaps isn't."""
    document = job.plan.to_document()
    change(document)
    surface = job.plan.surface
    surface = surface if mesh is None else replace(surface, mesh=mesh)
    truth = Scanner.of(RigPlan.from_document(document, surface))
    return reconstruct_rendered(
        job.scanner, job.expected, seed=0, threads=1, truth=truth
    )


def assert_certain_or_right(found: Reconstruction) -> None:
    """Points that are wrong are known to be uncertain."""
    off = np.abs(found.accuracy.distances)
    wrong = off > WRONG_M
    known = np.isfinite(found.merged.sigma)
    assert np.mean((off < 5.0 * found.merged.sigma)[wrong & known]) > 0.8


@pytest.mark.parametrize("devices", ["camera", "projector"])
def test_a_device_that_stands_elsewhere_costs_its_points_their_certainty(job, devices):
    """Points of one projector lie on its rings whatever camera is wrong."""
    names = ("world_from_device", "world_from_ring")

    def moved(document):
        device = document[f"{devices}s"][0]
        for name in names if devices == "projector" else names[:1]:
            device[name][0][3] += 4e-3

    found = stood_there(job, moved)
    pairs = ["P1 with C1", "P2 with C1" if devices == "camera" else "P1 with C2"]
    for pair, sentence in zip(pairs, found.failures, strict=False):
        assert sentence.startswith(f"{pair}: doubtful: where P")
        assert "a pose or optics aren't quite those of the plan" in sentence
    assert "doubtful" not in found.failures[2]
    assert_certain_or_right(found)
    sure = np.median(found.merged.sigma[found.merged.cloud.noise_px < 0.5])
    assert np.abs(found.accuracy.distances).max() > WRONG_M
    assert sure < 5e-5


def test_an_object_that_is_not_the_mesh_is_measured_and_said_to_differ(job):
    """Pairs agree with each other: the cloud is right, and the mesh is wrong."""
    old = job.plan.surface.mesh
    other = TriangleMesh(1.02 * old.vertices, old.faces)
    found = stood_there(job, lambda document: None, mesh=other)
    assert not found.passed
    assert "the object differs from it, or stands elsewhere" in found.failures[0]
    assert all(pair.n_points > 1000 for pair in found.pairs)
    distance = closest_points(other, found.merged.cloud.points).distances
    assert np.abs(distance).max() < WRONG_M


def test_where_no_majority_tells_which_camera_moved_nobody_is_certain(job):
    """Both of its pairs agree, so do the other camera's, and no mesh decides."""
    body = job.plan.surface.mesh
    down = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    on_its_side = TriangleMesh(body.vertices @ down.T, body.faces)

    def turned(document):
        pose = np.array(document["cameras"][0]["world_from_device"])
        turn = Rotation.from_euler("z", 0.2, degrees=True).as_matrix()
        pose[:3, :3] = turn @ pose[:3, :3]
        document["cameras"][0]["world_from_device"] = pose.tolist()

    found = stood_there(job, turned, mesh=on_its_side)
    cloud = found.everything
    # Certain or not, all of them stay.
    assert all(pair.n_points > 1500 for pair in found.pairs)
    assert sum("no majority tells" in why for why in found.failures) == 2
    off = closest_points(on_its_side, cloud.points).distances
    assert np.abs(off[cloud.camera == 1]).max() < WRONG_M
    wrong = np.abs(off) > WRONG_M
    assert np.mean(wrong[cloud.camera == 0]) > 0.3
    assert cloud.noise_px[wrong].min() >= AGREE_PX


def test_a_pair_is_not_confirmed_by_one_that_is_left_out(job):
    """The object moved between the projectors, out of the sight of P2 with C2."""
    ball = sphere(0.02, subdivisions=4)
    toward = np.array(job.plan.to_document()["cameras"][0]["world_from_device"])[:3, 3]
    nearer = 0.05 * toward / np.linalg.norm(toward)
    stacks = {}
    for p, shift in enumerate((nearer, 0.0 * nearer)):
        images = InMemory(Path("x"), job.scanner)
        truth = replace(
            job.scanner, mesh=TriangleMesh(ball.vertices + shift, ball.faces)
        )
        reconstruct_rendered(
            job.scanner, job.expected, seed=0, threads=1, truth=truth, save=images
        )
        stacks |= {key: stack for key, stack in images.stacks.items() if key[0] == p}
    found = job.of(stacks)
    told = {why.split(": ")[0]: why.split(": ")[1] for why in found.failures[:3]}
    assert told == {
        "P1 with C1": "doubtful",
        "P2 with C1": "left out",
        "P2 with C2": "doubtful",
    }


def test_a_deep_dent_that_two_pairs_saw_is_certain_and_one_pairs_word_is_not(job):
    old = job.plan.surface.mesh
    top = (
        old.vertices @ np.array([0.0, -1.0, 0.1]) / np.linalg.norm(old.vertices, axis=1)
    )
    depth = 0.04 * np.clip((top - 0.9) / 0.1, 0.0, 1.0)
    other = TriangleMesh((1.0 - depth)[:, None] * old.vertices, old.faces)
    found = stood_there(job, lambda document: None, mesh=other)
    distance = closest_points(other, found.merged.cloud.points).distances
    assert np.abs(distance).max() < WRONG_M
    assert found.accuracy.max_m > 1e-3
    assert not any("no other pair" in sentence for sentence in found.failures)
    assert not found.passed

    def alone(document):
        document["projectors"].pop()
        document["cameras"].pop()

    found = stood_there(job, alone, mesh=other)
    assert any("doubtful: far off the mesh" in sentence for sentence in found.failures)
    # Beyond noise.
    dent = np.abs(found.accuracy.distances) > 1.1e-3
    assert np.any(dent)
    assert found.merged.cloud.noise_px[dent].min() >= AGREE_PX
    assert np.median(found.merged.cloud.noise_px[~dent]) < 0.1 * AGREE_PX


def test_a_pair_without_light_is_missed_where_it_should_measure(job):
    found = job.after(lambda s: 0 * s)
    assert_left_out(found, "P1 with C1", "no light")
    assert "it should measure 1" in found.failures[0]
    spared = job.expected.by_pair.copy()
    spared[0, 0] = 0.0
    images = InMemory(
        Path("x"), job.scanner, job.images.stacks | {(0, 0): 0 * other(job)}
    )
    quiet = Expected(job.expected.samples, job.expected.measured, spared)
    found = reconstruct_captured(images, quiet, threads=1)
    assert not any("no light" in sentence for sentence in found.failures)


def other(job: Job) -> np.ndarray:
    return job.images.stacks[0, 0]


def test_no_light_at_all_is_an_error(job):
    dark = {key: 0 * stack for key, stack in job.images.stacks.items()}
    with pytest.raises(CapturesError, match=r"no light.*the other 3 pairs can't"):
        job.of(dark)


def test_files_give_the_cloud_that_was_made_before_they_were_written(saved):
    plan, expected, folder = saved
    before = reconstruct_rendered(Scanner.of(plan), expected, seed=0, threads=1)
    after = reconstruct_captured(folder, expected, threads=2)
    assert before.failures == after.failures == ()
    assert np.array_equal(before.merged.cloud.points, after.merged.cloud.points)
    names = sorted(p.name for p in (folder.path / "C2" / "P1").iterdir())
    assert names == [f"{name}.png" for name in sorted(folder.plan.frame_names(0, 1))]
    assert names[-1] == "15-root-C2-inverse.png"


def test_order_and_dates_of_files_mean_nothing_and_strangers_are_passed_over(copied):
    folder, expected = copied
    place = folder.place(0, 0)
    for path in sorted(place.iterdir(), reverse=True):
        path.write_bytes(path.read_bytes())
    (place / "notes.txt").write_text("taken on Friday")
    shutil.copy(place / "02-bit0.png", place / "preview.png")
    assert reconstruct_captured(folder, expected, threads=1).failures == ()


SPOILED = {
    "missing": (lambda f: f.unlink(), r"P1: lacks 04-bit1$"),
    "renamed": (
        lambda f: f.rename(f.with_name("bit1.png")),
        r"lacks 04-bit1; holds bit1.png, no frame's name",
    ),
    "twice": (
        lambda f: shutil.copy(f, f.with_suffix(".tif")),
        r"04-bit1.png, 04-bit1.tif are one frame",
    ),
    "empty": (lambda f: f.write_bytes(b""), r"04-bit1.png: not a readable image"),
    "text": (lambda f: f.write_text("hello"), r"04-bit1.png: not a readable image"),
    "cut": (
        lambda f: f.write_bytes(f.read_bytes()[: f.stat().st_size // 2]),
        r"04-bit1.png: not a readable image",
    ),
    "flipped byte": (lambda f: f.write_bytes(flipped(f)), r"not a readable image"),
    "folder": (lambda f: (f.unlink(), f.mkdir()), r"04-bit1.png: not a readable image"),
    "small": (
        lambda f: opened(f).resize((160, 120)).save(f),
        r"04-bit1.png: 160 x 120 px, must be the camera's 320 x 240",
    ),
    "turned": (
        lambda f: opened(f).transpose(Image.Transpose.ROTATE_90).save(f),
        r"240 x 320 px",
    ),
    "jpeg": (lambda f: opened(f).save(f, format="JPEG"), r"JPEG moves edges"),
    "jpeg in tiff": (
        lambda f: opened(f).save(f, format="TIFF", compression="jpeg"),
        r"TIFF moves edges",
    ),
    "two levels": (lambda f: opened(f).convert("1").save(f), r"pixels of mode 1"),
    "see-through": (
        lambda f: with_alpha(opened(f), 128).save(f),
        r"is partly transparent",
    ),
    "16 bits among 8": (
        lambda f: Image.fromarray(pixels(f).astype(np.uint16) * 257).save(f),
        r"04-bit1.png: 16 bits, 00-white.png has 8",
    ),
    "floats": (
        lambda f: Image.fromarray(pixels(f).astype(np.float32)).save(f, format="TIFF"),
        r"pixels of mode F",
    ),
    "two pages": (
        lambda f: opened(f).save(
            f, format="TIFF", save_all=True, append_images=[opened(f)]
        ),
        r"several images",
    ),
}


def opened(path: Path) -> Image.Image:
    with Image.open(path) as image:
        image.load()
        return image.copy()


def pixels(path: Path) -> np.ndarray:
    return np.array(opened(path))


def with_alpha(image: Image.Image, alpha: int) -> Image.Image:
    image = image.convert("RGBA")
    image.putalpha(alpha)
    return image


def flipped(path: Path) -> bytes:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    return bytes(content)


@pytest.mark.parametrize("fault", SPOILED)
def test_a_spoiled_file_costs_its_pair_and_is_named(copied, fault):
    folder, expected = copied
    spoil, why = SPOILED[fault]
    spoil(folder.place(0, 0) / "04-bit1.png")
    found = reconstruct_captured(folder, expected, threads=1)
    assert_no_wrong_point(found)
    assert [pair.n_points > 1000 for pair in found.pairs] == [False, True]
    assert found.failures[0].startswith("P1 with C1: left out: ")
    assert re.search(why, found.failures[0]), found.failures[0]


def as_rgb(path: Path) -> None:
    opened(path).convert("RGB").save(path)


def as_rgba(path: Path) -> None:
    with_alpha(opened(path), 255).save(path)


def as_palette(path: Path) -> None:
    opened(path).convert("P").save(path)


def as_tiff(path: Path) -> None:
    opened(path).save(path.with_suffix(".TIFF"), compression="tiff_lzw")
    path.unlink()


def as_bitmap(path: Path) -> None:
    opened(path).save(path.with_suffix(".bmp"))
    path.unlink()


def as_16_bits(path: Path) -> None:
    Image.fromarray(pixels(path).astype(np.uint16) * 257).save(path)


def as_12_bits(path: Path) -> None:
    """As a 12-bit sensor's numbers in 16 bits."""
    twelve = np.rint(pixels(path) * (4095 / 255)).astype(np.uint16)
    Image.fromarray(twelve).save(path.with_suffix(".tif"))
    path.unlink()


@pytest.mark.parametrize(
    "rewrite",
    [as_rgb, as_rgba, as_palette, as_tiff, as_bitmap, as_16_bits, as_12_bits],
)
def test_every_lossless_way_to_store_an_image_gives_the_same_cloud(
    saved, copied, rewrite
):
    folder, expected = copied
    for path in sorted(folder.path.rglob("*.png")):
        rewrite(path)
    found = reconstruct_captured(folder, expected, threads=1)
    before = reconstruct_captured(saved[2], expected, threads=1)
    assert found.failures == ()
    assert found.n_merged == pytest.approx(before.n_merged, rel=0.01)
    if rewrite is not as_12_bits:
        assert np.allclose(
            found.merged.cloud.points, before.merged.cloud.points, rtol=0, atol=1e-9
        )


def test_colours_are_clipped_where_one_channel_is(copied):
    """A blown red channel hides in the mean of the three."""
    folder, expected = copied
    for path in sorted(folder.place(0, 0).glob("*.png")):
        grey = pixels(path).astype(float)
        tinted = np.stack([1.6 * grey, 0.8 * grey, 0.6 * grey], axis=2)
        Image.fromarray(np.clip(np.rint(tinted), 0, 255).astype(np.uint8)).save(path)
    found = reconstruct_captured(folder, expected, threads=1)
    assert_no_wrong_point(found)
    assert "of the lit pixels are clipped" in found.remarks[0]


def test_missing_folders_are_named_with_what_is_there(copied):
    folder, expected = copied
    shutil.move(folder.place(0, 0), folder.path / "C1" / "p1x")
    found = reconstruct_captured(folder, expected, threads=1)
    assert found.failures[0].endswith(
        "no such folder; " + str(folder.path / "C1") + " holds p1x"
    )
    shutil.move(folder.path / "C1", folder.path / "left")
    found = reconstruct_captured(folder, expected, threads=1)
    assert "P1: no such folder" in found.failures[0]
    shutil.move(folder.path / "C2", folder.path / "right")
    with pytest.raises(CapturesError, match="must be called C1, C2, it holds left, r"):
        reconstruct_captured(folder, expected)
    nowhere = CaptureFolder(folder.path / "nowhere", folder.plan)
    with pytest.raises(CapturesError, match="nowhere: no such folder"):
        reconstruct_captured(nowhere, expected)


def test_folders_of_cameras_exchanged_show_by_the_names_of_their_root_discs(copied):
    folder, expected = copied
    one, two, away = (folder.path / name for name in ("C1", "C2", "away"))
    one.rename(away)
    two.rename(one)
    away.rename(two)
    with pytest.raises(CapturesError, match=r"lacks 12-root-C1, 13-root-C1-inverse"):
        reconstruct_captured(folder, expected)


LOW_NOISE = 0


def clean_images(job: Job, bits: int, blur_m: float) -> InMemory:
    """Images of a sensor of so many bits without noise, or with 2.2 e- at 8 bits."""
    steps = (1 << bits) - 1
    stacks = {}
    scanner = job.scanner
    clean = Photometry(noisy=False, projector_blur_m=blur_m)
    if bits == LOW_NOISE:
        steps, clean = 255, replace(clean, noisy=True, read_noise=2.2 * 255 / 10_000)

    def keep(p, c, frames):
        whole = whole_image(frames, scanner.cameras[c].resolution)
        stacks[p, c] = np.rint(whole / 255.0 * steps) * (255.0 / steps)
        return None

    decode_rendered(
        scanner, scanner, clean, seed=0, threads=1, spent=Spent(), develop=keep
    )
    if steps == 255:
        stacks = {pair: stack.astype(np.uint8) for pair, stack in stacks.items()}
    else:
        stacks = {pair: stack.astype(np.float32) for pair, stack in stacks.items()}
    return InMemory(Path("x"), scanner, stacks)


@pytest.mark.long
@pytest.mark.parametrize(
    ("bits", "blur_m"),
    [(bits, blur) for bits in (LOW_NOISE, 8, 12) for blur in (0.0, 1e-3)]
    + [(8, 2.5e-4), (10, 2.5e-4), (16, 2.5e-4)],
)
def test_clean_images_are_not_suspicious(lit_job, bits, blur_m):
    """Black may equal a root disc that is out of sight; nothing is too clean."""
    images = clean_images(lit_job, bits, blur_m)
    found = reconstruct_captured(images, lit_job.expected, threads=1)
    assert found.failures == ()
    before, after = (
        sum(pair.n_points for pair in one.pairs) for one in (lit_job.good, found)
    )
    # Blur of a sixth of a ring gap costs edges, with noise or without.
    share, ratio = (0.9, 1.6) if blur_m == 1e-3 else (0.97, 1.2)
    assert after > share * before
    assert found.accuracy.rms_m < ratio * lit_job.good.accuracy.rms_m
