"""Redundancy removed from hand-made clouds: which points stay."""

import numpy as np
import pytest

from planning.verify.reconstruction.check.merge import merge
from planning.verify.reconstruction.cloud import Cloud

GAP_M, PITCH_PX = 3.5e-3, 12.0


def sheet(
    *,
    camera: int = 0,
    projector: int = 0,
    z: float = 0.0,
    facing: float = 1.0,
    beam: tuple[float, float, float] = (0.0, 0.0, -1.0),
    noise_px: float = 0.02,
    width: int = 20,
) -> Cloud:
    """Rings a gap apart on a plane of constant z, seen square from above or below."""
    ring, along = (k.ravel() for k in np.meshgrid(np.arange(width), np.arange(200)))
    x, y = ring * GAP_M + 0.4e-3 * camera, along * 0.3e-3
    n = len(x)
    ray = np.array([0.0, 0.0, -facing])
    beam_direction = np.array(beam) / np.linalg.norm(beam)
    return Cloud(
        points=np.column_stack([x, y, np.full(n, z)]),
        rays=np.tile(ray, (n, 1)),
        beams=np.tile(beam_direction, (n, 1)),
        pixels=np.column_stack([x, y]) / 0.29e-3 + 100.0,
        camera=np.full(n, camera, np.int16),
        projector=np.full(n, projector, np.int16),
        ring=ring.astype(np.int16),
        conditioning=np.full(n, 0.4),
        shift=np.tile([1e-4, 0.0, 3e-4], (n, 1)),
        noise_px=np.full(n, noise_px),
    )


def merged(*clouds: Cloud):
    return merge(Cloud.join(clouds), gap_m=GAP_M, pitch_px=PITCH_PX)


def test_normals_point_to_the_camera_and_sigma_is_along_them():
    result = merged(sheet(noise_px=0.05))
    assert len(result.cloud) == 4000
    np.testing.assert_allclose(result.normals, [[0.0, 0.0, 1.0]] * 4000, atol=1e-9)
    # Along the normal, a tenth of the whole for the normal's error; texture's shift.
    shift = np.hypot(3e-4, 0.1 * np.hypot(1e-4, 3e-4))
    np.testing.assert_allclose(result.sigma, shift * np.hypot(0.05, 0.015))


@pytest.mark.parametrize("squarer", [0, 1])
def test_the_squarer_projector_stays_though_its_edges_are_noisier(squarer):
    clouds = [
        sheet(
            projector=p,
            beam=(0.2, 0.0, -1.0) if p == squarer else (1.0, 0.0, -1.0),
            noise_px=0.1 if p == squarer else 0.01,
        )
        for p in (0, 1)
    ]
    result = merged(*clouds)
    assert len(result.cloud) == 4000
    assert np.all(result.cloud.projector == squarer)


def test_a_projector_that_measured_little_gives_way():
    """Squarer, but with one point in eight of the other's: too few to stand for it."""
    few = sheet(projector=1).take(np.arange(0, 4000, 8))
    many = sheet(projector=0, beam=(0.6, 0.0, -1.0))
    result = merged(many, few)
    assert np.count_nonzero(result.cloud.projector == 0) == 4000
    assert np.count_nonzero(result.cloud.projector == 1) == 0


@pytest.mark.parametrize("sharper", [0, 1])
def test_of_two_cameras_the_smaller_sigma_stays(sharper):
    clouds = [sheet(camera=c, noise_px=0.02 if c == sharper else 0.03) for c in (0, 1)]
    result = merged(*clouds)
    assert np.mean(result.cloud.camera == sharper) > 0.75
    assert len(result.cloud) < 6000


def test_both_sides_of_a_thin_sheet_stay():
    front = sheet(camera=0, z=0.0)
    back = sheet(camera=1, z=-0.4e-3, facing=-1.0, beam=(0.0, 0.0, 1.0), noise_px=0.1)
    result = merged(front, back)
    assert np.count_nonzero(result.cloud.camera == 0) == 4000
    assert np.count_nonzero(result.cloud.camera == 1) == 4000


def test_lonely_points_have_no_normal_and_stay():
    few = sheet().take(np.arange(0, 4000, 1999))
    result = merged(few)
    assert len(result.cloud) == len(few) == 3
    assert np.all(np.isnan(result.normals))
    assert np.all(np.isnan(result.sigma))


def test_nothing_merges_to_nothing():
    result = merged(Cloud.empty())
    assert len(result.cloud) == len(result.sigma) == 0
