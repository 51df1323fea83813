"""What is said of a cell holds at each of its places, and not by much more."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_workspace

from geometry.arrays import Array
from planning.model.devices.bodies import Box
from planning.model.requirements import Workspace
from planning.verify.audit.devices.workspace_claims import outside_by
from planning.verify.audit.proofs.poses.admissible_cells import may_stand
from planning.verify.audit.proofs.poses.sphere_cells import (
    Cells,
    of_parallel,
    seen_from,
)

_SHELL = (0.9, 1.3)
_UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _cells(halvings: int) -> Cells:
    cells = Cells.of_shell(*_SHELL)
    for _ in range(halvings):
        cells = cells.halves(0.3)
    return cells


def _places(cells: Cells, n: int) -> Array:
    """Places in each cell, its corners among them, (cells, n, 3)."""
    rng = np.random.default_rng(1)
    share = rng.random((3, len(cells.low_m), n))
    share[:, :, : n // 2] = np.round(share[:, :, : n // 2])
    ends = zip(cells[::2], cells[1::2], strict=True)
    radius, polar, turn = (
        low[:, None] + s * (high - low)[:, None]
        for s, (low, high) in zip(share, ends, strict=True)
    )
    across = radius * np.sin(polar)
    x, y = across * np.cos(turn), across * np.sin(turn)
    return np.stack([x, y, radius * np.cos(polar)], axis=-1)


def _angle(a: Array, b: Array) -> Array:
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(across, np.sum(a * b, axis=-1))


@pytest.mark.parametrize("halvings", [2, 5, 8, 11])
def test_all_of_a_cell_is_seen_within_psi_and_its_distances(halvings) -> None:
    cells, rng = _cells(halvings), np.random.default_rng(2)
    cells = cells.take(rng.choice(len(cells.low_m), 32))
    points = rng.normal(size=(40, 3))
    points *= (0.7 * rng.random(40) / np.linalg.norm(points, axis=1))[:, None]
    vectors = rng.normal(size=(40, 3))
    seen = seen_from(cells, points, (vectors,))
    at, k = (grid.ravel() for grid in np.indices((32, 40)))
    towards = cells.towards(points, at, k)
    assert np.allclose(seen.along[0].ravel(), np.sum(towards * vectors[k], axis=1))
    way = _places(cells, 60)[at] - points[k][:, None]
    off = _angle(way, towards[:, None]).max(axis=1)
    psi, far = seen.psi.ravel(), np.linalg.norm(way, axis=2)
    assert np.all(off <= psi)
    assert np.all(far.min(axis=1) >= seen.nearest.ravel())
    assert np.all(far.max(axis=1) <= seen.farthest.ravel())
    if halvings >= 8:
        # A tenth less would be false, and mostly half of it as well.
        assert (off / psi).max() > 0.95
        assert np.median(off / psi) > 0.5
        assert np.min(far.min(axis=1) - seen.nearest.ravel()) < 0.02
        assert np.min(seen.farthest.ravel() - far.max(axis=1)) < 0.02


def test_parallel_light_comes_from_within_psi() -> None:
    cells = _cells(6)._replace(low_m=np.ones(512), high_m=np.ones(512))
    seen = of_parallel(cells, (np.eye(3),))
    off = _angle(_places(cells, 60), cells.middle[:, None]).max(axis=1)
    assert np.all(off <= seen.psi[:, 0])
    assert np.all(off > seen.psi[:, 0] - 1e-6)
    assert np.allclose(seen.along[0], cells.middle)


def test_halves_are_the_whole_cell_and_no_more() -> None:
    cells = _cells(7)
    low, high, *angles = cells
    polar, polar_end, turn, turn_end = angles
    volume = (
        (high**3 - low**3) * (np.cos(polar) - np.cos(polar_end)) * (turn_end - turn)
    )
    whole = 4.0 * np.pi * (_SHELL[1] ** 3 - _SHELL[0] ** 3)
    assert volume.sum() == pytest.approx(whole)
    # They are cut evenly, as they look.
    widths = cells.widths(0.3).max(axis=1)
    assert widths.max() < 3.0 * np.median(widths)


_TURNED = ((0.0, 1.0, 0.0), (-0.6, 0.0, 0.8), (0.8, 0.0, 0.6))
_SPACES: dict[str, dict[str, object]] = {
    "cone": {"half_angle": 0.7},
    "floor": {"floor_m": 0.4},
    "room": {"box": Box("room", (0.1, 0.0, 0.2), (0.8, 1.0, 0.7), _UPRIGHT)},
    "keep out": {
        "keep_out": (Box("pillar", (0.3, 0.9, 0.1), (0.5, 0.4, 0.6), _TURNED),)
    },
    "mounting": {
        "mounting": (
            Box("wall", (1.0, 0.0, 0.0), (0.05, 0.6, 0.6), _UPRIGHT),
            Box("beam", (0.0, 0.0, 1.0), (0.4, 0.1, 0.1), _TURNED),
        )
    },
}


@pytest.mark.parametrize("name", _SPACES)
def test_a_cell_that_holds_an_admissible_place_stays(name) -> None:
    space: Workspace = replace(make_workspace(0.3, 1.0), **_SPACES[name])
    for halvings in (3, 9, 12):
        cells = _cells(halvings)
        places = _places(cells, 30)
        outside = outside_by(places.reshape(-1, 3), _SHELL, space)
        stands = np.any(outside.reshape(places.shape[:2]) <= 0.0, axis=1)
        may = may_stand(space, cells)
        assert np.all(may[stands])
        # Fewer are left the smaller cells are, about as many as it takes.
        if halvings == 12:
            assert may.sum() < 1.6 * stands.sum() + 400
            assert may.sum() < 0.98 * len(may)
