"""The published covers, held against what their constructions promise."""

import gzip

import numpy as np
import pytest

NAMES = "map1 map2 stn27 stn45 scpe1 scpclr10 scp41 scp61 scpa1 scpcyc06".split()


@pytest.fixture
def read(set_cover_files):
    if not set_cover_files.FOLDER.is_dir():
        pytest.skip("the shared set cover instances aren't here")
    return lambda name: set_cover_files.BY_NAME[name].read()


def test_the_table_names_every_file(set_cover_files, read):
    assert [instance.name for instance in set_cover_files.INSTANCES] == NAMES
    files = {instance.file for instance in set_cover_files.INSTANCES}
    here = {path.name for path in set_cover_files.FOLDER.iterdir()}
    assert here - files <= {"LICENSE-viewpoint-matrices"}
    assert files <= here


@pytest.mark.parametrize("name", NAMES)
def test_matrices_are_canonical_and_can_be_covered(set_cover_files, read, name):
    covers, costs = read(name)
    instance = set_cover_files.BY_NAME[name]
    assert covers.dtype == bool
    assert covers.shape == (instance.rows, instance.columns)
    assert costs.shape == (instance.columns,)
    before = covers.nnz
    covers.sum_duplicates()
    assert covers.nnz == before
    assert np.diff(covers.indptr).min() >= 1
    assert (costs.max() > 1.0) == (instance.cheapest is not None)


@pytest.mark.parametrize("name", ["stn27", "stn45"])
def test_every_two_points_share_one_triple(read, name):
    covers, _ = read(name)
    counts = covers.astype(int)
    together = (counts.T @ counts).toarray()
    points = covers.shape[1]
    each = (points - 1) // 2
    assert np.array_equal(
        together, np.ones((points, points)) + (each - 1) * np.eye(points)
    )


def test_cycles_of_the_cube_have_four_edges_and_an_edge_lies_on_five(read):
    covers, _ = read("scpcyc06")
    assert set(covers.sum(axis=1)) == {4}
    assert set(covers.sum(axis=0)) == {5}


def test_viewpoints_cover_what_their_lines_say(set_cover_files, read):
    covers, _ = read("map2")
    lines = set_cover_files.BY_NAME["map2"].path.read_text().splitlines()
    sets = [{int(e) for e in line.split()[8:]} for line in lines if line.strip()]
    names = sorted(set().union(*sets))
    for s, column in enumerate(covers.T.toarray()):
        assert {names[e] for e in np.flatnonzero(column)} == sets[s]


def test_numbers_left_over_are_refused(set_cover_files, tmp_path, monkeypatch):
    monkeypatch.setattr(set_cover_files, "FOLDER", tmp_path)
    good = b"2 2  7 9  1 2  2 1 2"
    instance = set_cover_files.SetCoverFile("two", "two.gz", 2, 2, 1, proved=True)
    instance.path.write_bytes(gzip.compress(good))
    covers, costs = instance.read()
    assert covers.toarray().tolist() == [[False, True], [True, True]]
    assert costs.tolist() == [7.0, 9.0]
    instance.path.write_bytes(gzip.compress(good + b" 3"))
    with pytest.raises(ValueError, match="1 numbers are left over"):
        instance.read()
