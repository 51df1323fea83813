"""`plan --watch` and `plan cache`: what is told, and when it ends."""

import os
import signal
import subprocess
import sys
import threading
from queue import Queue

import pytest
from click.testing import CliRunner
from support.little_work import LITTLE, found_path
from support.plain_shapes import box

from planning.cache.entries import FolderEntries
from planning.cli.main import commands
from planning.cli.plans import watch_command

RUN = [sys.executable, "-c", LITTLE + "from planning.cli.main import main; main()"]


def _told(*words):
    return CliRunner().invoke(commands, words)


def test_the_cache_is_shown_and_cleared(tmp_path, monkeypatch):
    monkeypatch.setenv("RINGRIG_CACHE", str(tmp_path))
    assert "0 answers" in _told("cache").stdout
    FolderEntries(tmp_path).put("0" * 40, bytes(2_000_000))
    for words in ((), ("clear",)):
        said = _told("cache", *words).stdout
        assert said.startswith(f"{tmp_path}: 1 answer, 2.0 MB")
    assert "0 answers" in _told("cache").stdout
    monkeypatch.setenv("RINGRIG_CACHE", "")
    assert "nothing is kept" in _told("cache").stdout
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("RINGRIG_CACHE", str(file))
    refused = _told("cache", "clear")
    assert refused.exit_code == 3
    assert f"names {file}, which is no folder" in refused.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--watch", "absent.toml"), "isn't a file"),
        (("--watch", __file__, "--rig", "x.toml"), "--rig or --watch"),
        (("--watch", __file__, "--json"), "--json is of one plan"),
        (("--watch", "absent.toml", "--pareto"), "--pareto with --watch: a front"),
    ],
)
def test_what_cannot_be_watched_is_refused(words, said):
    result = _told("--mesh", "a.obj", "--max-projectors", "1", *words)
    assert result.exit_code == 2
    assert said in result.stderr


@pytest.mark.parametrize("saved", ["rig.toml", "a.obj", "b.obj"])
def test_each_mesh_of_a_family_is_watched(tmp_path, monkeypatch, capsys, saved):
    for name in ("rig.toml", "a.obj", "b.obj"):
        (tmp_path / name).write_text("as it was")
    plans = []

    def replanned(*_):
        plans.append(saved)
        (tmp_path / saved).write_text("saved meanwhile")
        # As Ctrl-C ends a plan.
        return (0 if len(plans) == 1 else 130), None

    def asleep(seconds):
        if seconds:
            raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(watch_command, "_SETTLED_S", 0.0)
    monkeypatch.setattr(watch_command, "_replanned", replanned)
    monkeypatch.setattr(watch_command.time, "sleep", asleep)
    asked = {"watch": "rig.toml", "ranges": None, "meshes": ("a.obj", "b.obj")}
    asked |= {"no_cache": True, "quiet": False}
    assert watch_command.watch_command(asked, []) == 130
    assert plans == [saved, saved]
    assert (
        "waiting for rig.toml or one of 2 meshes to be saved" in capsys.readouterr()[1]
    )


@pytest.fixture
def watch(tmp_path, small_job):
    """A run that watches, its rig file, and what waits for a line of it."""
    shape, rig = box((100.0, 60.0, 30.0)), tmp_path / "rig.toml"
    lines = [f"v {x} {y} {z}" for x, y, z in shape.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in shape.faces + 1]
    (tmp_path / "block.obj").write_text("\n".join(lines))
    rig.write_text(small_job.RIG + "[requirements]\ndominant_coverage = 0.6\n")
    words = ["--mesh", "block.obj", "--max-projectors", "3", "--watch", "rig.toml"]
    words += ["--target", "surface", "--no-check", "--no-report", "--no-patterns"]
    words += ["--cameras-by", "cover", "--threads", "1"]
    with subprocess.Popen(
        [*RUN, *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": found_path()},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    ) as run:
        lines: Queue[str] = Queue()

        def read():
            assert run.stderr is not None
            for line in run.stderr:
                lines.put(line.decode())

        threading.Thread(target=read, daemon=True).start()

        def until(words):
            said = []
            while not (said and words in said[-1]):
                said.append(lines.get(timeout=120.0))
            return said

        yield run, rig, until
        run.kill()


@pytest.mark.long
def test_a_rig_file_that_is_saved_is_planned_again_and_what_changed_is_told(watch):
    run, rig, until = watch
    text = rig.read_text()
    assert not any("changed" in line for line in until("waiting for"))
    rig.write_text(text[: len(text) // 2] + "[[[")
    broken = until("waiting for")
    assert len(broken) == 2, broken
    assert "rig.toml" in broken[0]
    rig.write_text(text + "coverage = 0.8\n")
    said = until("waiting for")
    assert any("changed: measured, asked 95 % -> 80 %" in line for line in said)
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=60.0) == 0
