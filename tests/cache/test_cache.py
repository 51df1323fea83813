"""Answers that are recalled: the same values, computed once, or anew without harm."""

import os
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from geometry.shapes.primitives import sphere
from planning.cache.cache import NO_CACHE, Cache, cache_folder
from planning.cache.entries import FolderEntries
from planning.proofs.selection import CandidateCover


@dataclass
class Counted:
    """A function that counts how often it was asked."""

    value: object
    asked: int = 0

    def __call__(self):
        self.asked += 1
        return self.value


@pytest.fixture(params=["disk", "memory"])
def cache(request, tmp_path):
    if request.param == "memory":
        return Cache.in_memory()
    return Cache.on_disk(tmp_path / "cache")


def test_a_function_is_asked_once_for_each_of_its_inputs(cache):
    answer = Counted(np.arange(3.0))
    for inputs in ((1,), (1,), (2,), (1,)):
        kept = cache.recall("f", inputs, answer)
        np.testing.assert_array_equal(kept, answer.value)
    assert answer.asked == 2
    cache.recall("g", (1,), answer)
    assert answer.asked == 3


def test_without_a_cache_inputs_are_not_even_read():
    assert NO_CACHE.recall("f", (object(),), lambda: 7) == 7


def test_what_is_shared_is_the_caller_s_own(cache):
    lent = [object(), object()]
    cache.recall("f", (), lambda: (lent[1], 5, lent[0]), shared=lent)
    other = [object(), object()]
    kept = cache.recall("f", (), lambda: 0, shared=other)
    assert kept[0] is other[1]
    assert kept[1] == 5
    assert kept[2] is other[0]


def test_values_come_back_to_the_last_bit_without_what_follows_from_them(cache):
    mesh = sphere(0.1, subdivisions=2)
    cover = CandidateCover(mesh.vertices > 0.0, 1.0 / 3.0)
    assert mesh.area > 0.0
    assert cover.required > 0
    cache.recall("f", (), lambda: (mesh, cover))
    kept, other = cache.recall("f", (), lambda: None)
    np.testing.assert_array_equal(kept.vertices, mesh.vertices)
    np.testing.assert_array_equal(other.covers, cover.covers)
    assert other.share == cover.share
    for value, fields in ((kept, 4), (other, 7)):
        assert len(vars(value)) == fields
    assert kept.area == mesh.area


def test_code_is_part_of_the_key(cache, monkeypatch):
    answer = Counted(1)
    cache.recall("f", (), answer)
    monkeypatch.setattr("planning.cache.cache.code_content", lambda: "other code")
    cache.recall("f", (), answer)
    assert answer.asked == 2


class _Evil:
    def __reduce__(self):
        return os.mkdir, ("evil",)


def test_an_entry_that_others_put_there_runs_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cache = Cache.on_disk(tmp_path / "cache")
    cache.recall("f", (), lambda: 1)
    (path,) = (tmp_path / "cache").iterdir()
    FolderEntries(path.parent).put(path.stem, pickle.dumps(_Evil()))
    assert cache.recall("f", (), lambda: 2) == 2
    assert not (tmp_path / "evil").exists()
    # It was computed anew, and that is kept.
    assert cache.recall("f", (), lambda: 3) == 2


def test_a_folder_that_cannot_be_written_is_told_once_and_costs_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    said = []
    cache = Cache.on_disk(tmp_path / "file" / "cache", said.append)
    assert [cache.recall("f", (k,), lambda: 4) for k in range(3)] == [4, 4, 4]
    assert len(said) == 1
    for word in (str(tmp_path), "RINGRIG_CACHE", "--no-cache"):
        assert word in said[0]


def test_where_it_is(monkeypatch, tmp_path):
    monkeypatch.setenv("RINGRIG_CACHE", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own"
    monkeypatch.setenv("RINGRIG_CACHE", "")
    assert cache_folder() is None
    assert Cache.on_disk().entries is None
    monkeypatch.delenv("RINGRIG_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    folder = cache_folder()
    assert folder is not None
    assert folder.name == "ringrig"
