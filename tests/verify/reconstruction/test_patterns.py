"""Pattern files: decoded, from the files alone, by code of this test's own."""

import json
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from planning.model.errors import CapturesError
from planning.model.plan import RigPlan
from planning.verify.reconstruction.pattern_files import check_patterns, write_patterns
from planning.verify.reconstruction.scanner import Scanner


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def written(request, rigs, tmp_path_factory):
    """A plan of one projector and two cameras, and what was written for it."""
    plan = _plan(rigs, request.param)
    folder = tmp_path_factory.mktemp(request.param)
    return plan, write_patterns(Scanner.of(plan), folder)


def _plan(rigs, light) -> RigPlan:
    project = rigs.parallel if light == "parallel" else rigs.diverging
    entry = project("P1", 1.0 * rigs.direction(0.0, 10.0), 0.11, 0.004)
    if light == "parallel":
        entry |= {"resolution": [640, 600], "pixel_pitch_m": 0.65e-3}
    # Uneven rings, wider outside.
    radii = np.array(entry["ring_radii"])
    entry["ring_radii"] = (radii * (0.6 + 0.4 * radii / radii[-1])).tolist()
    cameras = [
        rigs.camera("C1", rigs.direction(30.0, 20.0)),
        rigs.camera("C2", rigs.direction(-20.0, -25.0)),
    ]
    return rigs.plan_of(rigs.bumpy_sphere(0.1, subdivisions=2), [entry], cameras)


def ring_plane_of(projector, pixels):
    """Points of the ring plane that pixels show: by rays, in this test's own words."""
    turn = projector.world_from_ring[:3, :3].T @ projector.world_from_device[:3, :3]
    device = projector.device
    if projector.light == "diverging":
        matrix = device.camera_matrix
        x = (pixels[:, 0] - matrix[0, 2]) / matrix[0, 0]
        y = (pixels[:, 1] - matrix[1, 2]) / matrix[1, 1]
        ray = np.column_stack([x, y, np.ones(len(x))]) @ turn.T
        return ray[:, :2] / ray[:, 2:]
    width, height = device.resolution
    x = (pixels[:, 0] - (width - 1) / 2) * device.pixel_pitch_m
    y = (pixels[:, 1] - (height - 1) / 2) * device.pixel_pitch_m
    offset = projector.world_from_device[:3, 3] - projector.world_from_ring[:3, 3]
    place = np.column_stack([x, y, np.zeros(len(x))]) @ turn.T
    return (place + projector.world_from_ring[:3, :3].T @ offset)[:, :2]


def read(folder, name):
    return np.asarray(Image.open(folder / name)).astype(float)


def frames_of(folder):
    manifest = json.loads((folder / "sequence.json").read_text())
    return manifest["projectors"][0]


def test_the_sequence_has_as_many_frames_as_the_formula_says(written):
    plan, folder = written
    entry = frames_of(folder)
    n = len(plan.projectors[0].ring_radii) + 1
    assert entry["n_annuli"] == n
    bits = int(np.ceil(np.log2(n)))
    assert len(entry["frames"]) == 2 * bits + 2 + 2 * len(plan.cameras)
    kinds = [frame["kind"] for frame in entry["frames"]]
    assert kinds == ["white", "black"] + ["bit"] * (2 * bits) + ["root"] * 4
    for plain, inverse in pairwise(entry["frames"][2:]):
        if not plain["inverse"]:
            assert inverse["inverse"]
            same = ("kind", "bit", "camera")
            assert [plain[k] for k in same] == [inverse[k] for k in same]
    files = {p.relative_to(folder).as_posix() for p in folder.rglob("*.*")}
    listed = {f["png"] for f in entry["frames"]}
    assert files == listed | {"sequence.json"}


def test_images_decode_to_the_annulus_of_every_pixel(written):
    plan, folder = written
    projector, entry = plan.projectors[0], frames_of(folder)
    width, height = projector.device.resolution
    white = read(folder, entry["frames"][0]["png"])
    assert white.shape == (height, width)
    assert read(folder, entry["frames"][1]["png"]).max() == 0
    code = np.zeros((height, width), dtype=int)
    for frame in entry["frames"]:
        if frame["kind"] == "bit" and not frame["inverse"]:
            image = read(folder, frame["png"])
            code |= (2 * image > white).astype(int) << frame["bit"]
    binary, shift = code.copy(), code >> 1
    while shift.any():
        binary ^= shift
        shift >>= 1
    v, u = np.indices((height, width))
    plane = ring_plane_of(projector, np.column_stack([u.ravel(), v.ravel()]))
    rho = np.hypot(*plane.T).reshape(height, width)
    radii = projector.ring_radii
    annulus = np.searchsorted(radii, rho)
    drawn = white == 255
    assert drawn.mean() > 0.2
    down, across = np.gradient(rho)
    away = np.abs(rho[..., None] - radii).min(axis=-1) / np.hypot(down, across)
    sure = drawn & (away > 0.02)
    assert np.array_equal(binary[sure], annulus[sure])
    # One more gap than rings is drawn, and nothing beyond.
    last = 2 * radii[-1] - radii[-2]
    assert np.all(white[rho > last + 1.5 * np.hypot(down, across)] == 0)


def test_edges_lie_where_the_radii_say_to_a_fiftieth_of_a_pixel(written):
    """A pixel's area, averaged over two, is d = level off, or 1.5 - sqrt(2 - 2 level).

    Of a pixel's centre d off the edge the share within half a pixel is linear in d,
    and beyond that its fill to the end at 1.5 is quadratic.
    """
    plan, folder = written
    projector, entry = plan.projectors[0], frames_of(folder)
    flips = np.array(entry["flipping_bit"])
    by_bit = {(f["bit"], f["inverse"]): f["png"] for f in entry["frames"]}
    seen = set()
    for bit in range(entry["n_bits"]):
        one, other = (read(folder, by_bit[bit, inverse]) for inverse in (False, True))
        level = (one - other) / 255.0
        v, u = np.nonzero((one + other == 255) & (np.abs(level) < 0.9))
        places = np.column_stack([u, v]).astype(float)
        half = 0.5
        rho, right, left, down, up = (
            np.hypot(*ring_plane_of(projector, places + np.array(step)).T)
            for step in ((0, 0), (half, 0), (-half, 0), (0, half), (0, -half))
        )
        slope = np.hypot(right - left, down - up)
        own = projector.ring_radii[flips == bit]
        off = (rho[:, None] - own) / slope[:, None]
        nearest = np.abs(off).argmin(axis=1)
        found = off[np.arange(len(off)), nearest]
        bright = np.abs(level[v, u])
        away = np.where(bright < 0.5, bright, 1.5 - np.sqrt(2.0 - 2.0 * bright))
        assert np.abs(np.abs(found) - away).max() < 0.02
        # Bright outside an edge where the bit is set beyond it.
        ring = np.flatnonzero(flips == bit)[nearest]
        beyond = ((ring + 1) ^ ((ring + 1) >> 1)) >> bit & 1
        clear = np.abs(level[v, u]) > 0.1
        outward = np.where(beyond == 1, 1.0, -1.0) * level[v, u]
        assert np.all((outward * found)[clear] > 0)
        seen |= set(ring.tolist())
    assert len(seen) > 0.9 * len(flips)


def test_root_discs_tell_the_sign_of_r_dot_m(written):
    plan, folder = written
    projector, entry = plan.projectors[0], frames_of(folder)
    rng = np.random.default_rng(0)
    width, height = projector.device.resolution
    pixels = rng.integers([0, 0], [width, height], (4000, 2))
    plane = ring_plane_of(projector, pixels.astype(float))
    rho = np.hypot(*plane.T)
    white = read(folder, entry["frames"][0]["png"])[pixels[:, 1], pixels[:, 0]]
    for camera in plan.cameras:
        names = {
            f["inverse"]: f["png"] for f in entry["frames"] if f["camera"] == camera.id
        }
        bright, dark = (
            read(folder, names[inverse])[pixels[:, 1], pixels[:, 0]]
            for inverse in (False, True)
        )
        assert np.array_equal(bright + dark, white)
        frame = projector.world_from_ring
        eye = frame[:3, :3].T @ (camera.world_from_device[:3, 3] - frame[:3, 3])
        # A point on the light of each pixel, and the ring surface's normal there.
        if projector.light == "diverging":
            point = np.column_stack([plane, np.ones(len(plane))])
            normal = np.column_stack([plane / rho[:, None], -rho])
        else:
            point = np.column_stack([plane, np.ones(len(plane))])
            normal = np.column_stack([plane / rho[:, None], np.zeros(len(plane))])
        ray = point - eye
        along = np.einsum("ij,ij->i", ray, normal)
        along /= np.linalg.norm(ray, axis=1)
        sure = (white == 255) & (np.abs(along) > 0.01)
        assert np.array_equal(bright[sure] > 127, along[sure] > 0)
        assert 0.02 < np.mean(along[sure] > 0) < 0.98


def test_the_same_plan_gives_the_same_bytes(written, tmp_path):
    plan, folder = written
    again = write_patterns(Scanner.of(plan), tmp_path)
    names = sorted(p.relative_to(folder) for p in folder.rglob("*.*"))
    assert names == sorted(p.relative_to(again) for p in again.rglob("*.*"))
    for name in names:
        assert (folder / name).read_bytes() == (again / name).read_bytes()


def test_patterns_of_another_plan_are_refused(written, rigs, tmp_path):
    plan, place = written
    check_patterns(Scanner.of(plan), place.parent)
    check_patterns(Scanner.of(plan), place)
    check_patterns(Scanner.of(plan), tmp_path)
    other = _plan(rigs, "parallel" if plan.projectors[0].light != "parallel" else "x")
    with pytest.raises(CapturesError, match="patterns of another plan"):
        check_patterns(Scanner.of(other), place.parent)
    # Checked or not, it is the same plan.
    record = plan.document.changed(truncated=True, command=("plan", "again"))
    check_patterns(Scanner.of(RigPlan(record, plan.surface)), place)
