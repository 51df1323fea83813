"""Outputs appear whole or not at all, and what stood there stays until then."""

import os
import signal
from functools import partial

import pytest

from geometry.files.readers import load_mesh
from planning import RigPlan, load_rig
from planning.model.files import write_atomically, write_together
from planning.model.surface import Surface
from planning.scene.ranges.ranged_body import read_ranges
from planning.verify.reconstruction.captures.images import read_grey


def test_a_failed_write_keeps_the_old_content_and_leaves_no_litter(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text("old")

    def fail(file):
        file.write(b"half")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.json"]


def test_files_that_belong_together_move_together(tmp_path):
    """The second fails, so the first isn't replaced either."""
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text("old a")
    second.write_text("old b")

    def fail(file):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_together({first: lambda file: file.write(b"new a"), second: fail})
    assert (first.read_text(), second.read_text()) == ("old a", "old b")
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]
    write_together(
        {
            first: lambda file: file.write(b"new a"),
            second: lambda file: file.write(b"new b"),
        }
    )
    assert (first.read_text(), second.read_text()) == ("new a", "new b")
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]


def test_a_folder_in_a_files_place_is_named_and_no_other_file_written(tmp_path):
    (tmp_path / "b").mkdir()
    files = {tmp_path / name: lambda file: file.write(b"new") for name in "ab"}
    with pytest.raises(IsADirectoryError) as refused:
        write_together(files)
    where = tmp_path / "b"
    assert (
        str(refused.value) == f"{where} is a folder, and a file is to be there; move it"
    )
    assert os.listdir(tmp_path) == ["b"]


def test_files_are_readable_by_others_as_a_plain_open_makes_them(tmp_path):
    write_atomically(tmp_path / "a", lambda file: file.write(b"x"))
    (tmp_path / "b").write_bytes(b"x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders there")
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("part.stl", load_mesh),
        ("rig.toml", load_rig),
        ("plan.json", RigPlan.load),
        ("surface.npz", Surface.load),
        ("ranges.csv", read_ranges),
        ("white.png", partial(read_grey, resolution=(4, 3))),
    ],
)
def test_nobody_waits_for_a_pipe(tmp_path, name, read):
    """Opening one that nobody writes to never returns."""
    os.mkfifo(tmp_path / name)

    def too_late(*_):
        raise AssertionError("still waiting")

    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(5)
    try:
        with pytest.raises(ValueError, match="not a regular file"):
            read(tmp_path / name)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
