"""Entries on disk: whole or none, the oldest go, strangers' files stay."""

import os
import subprocess
import sys
import time

import pytest

from planning.cache.entries import FolderEntries

KEYS = [f"{k:040x}" for k in range(1, 9)]


@pytest.fixture
def entries(tmp_path):
    return FolderEntries(tmp_path / "ours", limit_bytes=5000)


def test_what_was_put_is_got_and_nothing_else(entries):
    assert entries.get(KEYS[0]) is None
    assert entries.size() == (0, 0)
    entries.put(KEYS[0], b"one")
    entries.put(KEYS[0], b"two")
    assert entries.get(KEYS[0]) == b"two"
    assert entries.get(KEYS[1]) is None
    assert entries.size()[0] == 1


@pytest.mark.parametrize("damage", ["cut", "emptied", "a bit", "longer"])
def test_a_damaged_entry_is_none_and_goes(entries, damage):
    entries.put(KEYS[0], bytes(range(256)))
    (path,) = entries.folder.iterdir()
    data = bytearray(path.read_bytes())
    data[100] ^= damage == "a bit"
    ends = {"cut": 60, "emptied": 0, "a bit": None, "longer": None}
    path.write_bytes(bytes(data)[: ends[damage]] + b"x" * (damage == "longer"))
    assert entries.get(KEYS[0]) is None
    assert not path.exists()


def test_an_entry_under_another_key_is_none_and_goes(entries):
    entries.put(KEYS[0], b"one")
    (path,) = entries.folder.iterdir()
    moved = path.rename(path.with_stem(KEYS[1]))
    assert entries.get(KEYS[1]) is None
    assert not moved.exists()


def test_those_used_longest_ago_make_room(entries):
    for age, key in enumerate(KEYS[:4]):
        entries.put(key, bytes(1000))
        os.utime(entries.folder / f"{key}.ringrig", (1e9 + age, 1e9 + age))
    assert entries.get(KEYS[0]) is not None
    entries.put(KEYS[4], bytes(1000))
    held = [key for key in KEYS if entries.get(key) is not None]
    assert held == [KEYS[0], *KEYS[2:5]]
    assert entries.size()[1] <= entries.limit_bytes


def test_only_our_own_files_are_counted_and_dropped(entries):
    entries.put(KEYS[0], b"one")
    strangers = ["mine.txt", "x.ringrig", ".hidden", f"{KEYS[0]}.txt"]
    for name in strangers:
        (entries.folder / name).write_bytes(bytes(9000))
    old = entries.folder / f".{KEYS[1]}.ringrig.left"
    new = entries.folder / f".{KEYS[2]}.ringrig.busy"
    for part in (old, new):
        part.write_bytes(bytes(9000))
    os.utime(old, (1.0, 1.0))
    entries.put(KEYS[3], b"two")
    assert entries.size()[0] == 2
    assert not old.exists()
    assert new.exists()
    folder = f"{KEYS[1]}.ringrig"
    (entries.folder / folder).mkdir()
    strangers.append(folder)
    entries.clear()
    assert sorted(path.name for path in entries.folder.iterdir()) == sorted(strangers)


WRITER = """
import sys
from pathlib import Path
from planning.cache.entries import FolderEntries
entries, k = FolderEntries(Path(sys.argv[1]), 3_000_000), 0
print("begun", flush=True)
while True:
    k += 1
    key = f"{k % 40:040x}"
    found = entries.get(key)
    assert found is None or found == bytes([k % 40]) * 100_000
    entries.put(key, bytes([k % 40]) * 100_000)
"""


def test_parallel_writers_that_are_killed_leave_whole_entries(entries):
    def begun():
        words = [sys.executable, "-c", WRITER, str(entries.folder)]
        writer = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        writer.stdout.readline()
        return writer

    lasting = begun()
    for _ in range(5):
        writer = begun()
        time.sleep(0.05)
        writer.kill()
        writer.communicate()
    assert lasting.poll() is None
    lasting.kill()
    lasting.communicate()
    found = {k: entries.get(f"{k:040x}") for k in range(40)}
    held = {k: data for k, data in found.items() if data is not None}
    assert len(held) > 10
    assert all(data == bytes([k]) * 100_000 for k, data in held.items())
