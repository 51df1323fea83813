"""Cells of directions: every direction has its cell, every segment its cells."""

import numpy as np
import pytest

from geometry.directions.cube_cells import mark_segments
from geometry.directions.cube_map import (
    CubeMap,
    angle_between,
    circles,
    located,
    middles,
    quarters,
    widest,
)
from geometry.directions.widened_maps import WidenedMaps, _widened


def directions(n: int, seed: int = 0) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def turned(start: np.ndarray, angle: np.ndarray | float, seed: int = 1) -> np.ndarray:
    """Directions at an angle from given ones, to a random side."""
    aside = np.random.default_rng(seed).normal(size=start.shape)
    aside -= start * np.einsum("ij,ij->i", start, aside)[:, None]
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    angle = np.broadcast_to(angle, len(start))[:, None]
    return np.cos(angle) * start + np.sin(angle) * aside


@pytest.mark.parametrize("n", [1, 2, 3, 8, 32])
def test_cells_hold_their_directions(n):
    cube = CubeMap(n)
    assert cube.centres.shape == (cube.size, 3)
    assert cube.locate(7.0 * cube.centres).tolist() == list(range(cube.size))
    some = directions(20_000)
    off = angle_between(some, cube.centres[cube.locate(some)])
    assert np.all(off <= cube.radii[cube.locate(some)])
    # Radii aren't larger than they must be.
    assert off.max() > 0.9 * cube.radii.max()
    ends = cube.lines[[0, -1]]
    np.testing.assert_allclose(ends, [-1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("level", [0, 1, 5, 20])
def test_circles_hold_cells_of_any_level_and_none_is_wider_than_the_widest(level):
    # Of a map of 2^20 cells an edge nothing could be kept.
    some = directions(20_000)
    cells, levels = located(some, 1 << level), np.full(len(some), level)
    centres, radii = circles(levels, cells)
    assert located(centres, 1 << level).tolist() == cells.tolist()
    off = angle_between(centres, some)
    assert np.all(off <= radii)
    assert np.all(radii <= widest(levels) + 1e-15)
    assert np.max(off / radii) > 0.95
    # The middles of its four parts lie within it.
    for part in quarters(levels, cells).T:
        assert np.all(angle_between(centres, middles(levels + 1, part)) <= radii)


@pytest.mark.parametrize("n", [1, 2, 4, 16, 64])
def test_no_direction_leaves_the_neighbours_within_the_clearance(n):
    cube = CubeMap(n)
    some = directions(40_000)
    # Corners and edges of the cube are where it could happen.
    corner = np.array([[1.0, 1, 1], [1, 1, 0], [-1, 1, 1], [0, -1, 1]]) / np.sqrt(3)
    near = np.repeat(corner, 5_000, axis=0) + 0.02 * directions(20_000, seed=5)
    some = np.concatenate([some, near / np.linalg.norm(near, axis=1, keepdims=True)])
    cell = cube.locate(some)
    there = cube.locate(turned(some, cube.clearance))
    assert np.any(cell != there)
    # Columns that are each open in one cell, widened.
    asked = np.arange(0, len(some), 8)
    rows = np.zeros((cube.size, asked.size), dtype=bool)
    rows[there[asked], np.arange(asked.size)] = True
    wide = np.unpackbits(_widened(np.packbits(rows, axis=1), cube), axis=1)
    assert np.all(wide[cell[asked], np.arange(asked.size)])


@pytest.mark.parametrize("n", [2, 4, 16])
def test_halving_joins_four_cells(n):
    cube, coarse = CubeMap(n), CubeMap(n // 2)
    for cell in range(cube.size):
        marks = np.zeros((cube.size, 1), dtype=bool)
        marks[cell] = True
        wanted = coarse.locate(cube.centres[cell][None])
        assert np.flatnonzero(cube.halved(marks)).tolist() == wanted.tolist()


@pytest.mark.parametrize("n", [1, 4, 16, 64])
@pytest.mark.parametrize("length", [0.01, 0.3, 3.0])
def test_segments_mark_the_cells_they_pass_and_hardly_more(n, length):
    cube, m = CubeMap(n), 300
    rng = np.random.default_rng(n)
    starts = rng.normal(size=(m, 3))
    ends = starts + length * rng.normal(size=(m, 3))
    marks = np.zeros((m, cube.size), dtype=bool)
    mark_segments(cube, starts, ends, np.arange(m), marks)
    passed = np.zeros_like(marks)
    for t in np.linspace(0.0, 1.0, 1_500):
        passed[np.arange(m), cube.locate(starts + t * (ends - starts))] = True
    assert not np.any(passed & ~marks)
    assert marks.sum() <= 1.05 * passed.sum()


def test_segments_of_no_length_and_through_the_origin_have_cells():
    cube = CubeMap(8)
    starts = np.array([[1.0, 2, 3], [0, 0, 0], [1, 1, 1], [0.3, 0, 1]])
    ends = np.array([[1.0, 2, 3], [0, 0.1, 2], [-1, -1, -1], [0.3, 1e-12, 1]])
    marks = np.zeros((4, cube.size), dtype=bool)
    mark_segments(cube, starts, ends, np.arange(4), marks)
    for row, seen in enumerate([(starts, ends), (ends,), (starts, ends), (starts,)]):
        for points in seen:
            assert marks[row, cube.locate(points[[row]])].all()
    assert marks[0].sum() == 1
    assert marks[3].sum() <= 2


def test_segments_along_the_lines_between_cells_mark_both_sides():
    cube = CubeMap(4)
    marks = np.zeros((1, cube.size), dtype=bool)
    mark_segments(
        cube,
        np.array([[2.0, 0, 0]]),
        np.array([[2.0, 0, 1]]),
        np.zeros(1, dtype=np.int64),
        marks,
    )
    for side in (-1e-9, 1e-9):
        line = np.array([[2.0, side, z] for z in np.linspace(0.01, 1.0, 50)])
        assert marks[0, cube.locate(line)].all()


@pytest.mark.parametrize("n", [1, 2, 3, 16, 64, 200])
def test_rows_and_columns_are_those_between_the_lines(n):
    cube = CubeMap(n)
    beside = cube.lines[:, None] + np.array([-1e-7, -1e-15, 0.0, 1e-15, 1e-7])
    asked = np.concatenate([beside.ravel(), np.linspace(-1.0, 1.0, 5000)])
    found = np.searchsorted(cube.lines, asked, side="right") - 1
    np.testing.assert_array_equal(cube.cells_at(asked), np.clip(found, 0, n - 1))


@pytest.mark.parametrize("n", [4, 32])
def test_widened_maps_never_miss_an_open_direction(n):
    """Open cells are few; whoever is within the angle of one must be told."""
    cube, samples = CubeMap(n), 20
    rng = np.random.default_rng(n)
    is_open = np.zeros((samples, cube.size), dtype=bool)
    targets = directions(samples, seed=9)
    is_open[np.arange(samples), cube.locate(targets)] = True
    rows = np.zeros((cube.size, 8), dtype=np.uint8)
    packed = np.packbits(is_open, axis=0)
    rows[:, : len(packed)] = packed.T
    maps = WidenedMaps(rows.view(np.uint64), cube)
    which = rng.integers(samples, size=20_000)
    angles = rng.uniform(0.0, 1.2, which.size) ** 2
    asked = turned(targets[which], angles)

    def found_open(angles):
        return maps.open(asked, angles, which, maps.places(asked, angles))

    assert found_open(angles + 1e-9).all()
    # Nor does it call everything open.
    far = angle_between(asked, targets[which]) > 0.5
    closed = ~found_open(np.full(which.size, 0.01))
    assert closed[far].mean() > (0.9 if n == 32 else 0.0)
    # Of next to no cone the cell that it lies in decides, but at borders of faces.
    own = is_open[which, cube.locate(asked)]
    found = found_open(np.full(which.size, 1e-7))
    assert np.all(found[own])
    assert np.mean(found != own) < 1e-3
    assert found_open(np.full(which.size, 3.2)).all()
