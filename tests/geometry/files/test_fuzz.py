"""Damaged files of every format, read in a worker that may die; more in benchmarks/."""

import numpy as np
import pytest

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import MeshError

SEED = 4
COUNT = 80


def test_no_damaged_file_escapes(fuzzing) -> None:
    answers = fuzzing.run(SEED, range(COUNT))
    escaped = [answer for answer in answers if "escaped" in answer]
    assert escaped == []
    read = [answer for answer in answers if answer["read"]]
    # Both ends must be reached, or nothing was tried.
    assert COUNT / 10 < len(read) < COUNT / 2
    assert sum(answer.get("curved", False) for answer in read) >= 1


def test_the_undamaged_files_hold_the_same_ball(fuzzing, tmp_path) -> None:
    v, f = fuzzing.ball()
    a, b, c = (v[f[:, k]] for k in range(3))
    area = 1e-6 * 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    names = [name for name, _ in fuzzing.originals()]
    kinds = {name.partition(".")[2] for name in names}
    assert kinds == {"obj", "ply", "stl", "off", "glb", "gltf", "3mf"}
    twice = {"two.glb", "inside.gltf", "parts.3mf"}
    # A triangle of the ball again, and a quad over two of its faces, one of them new.
    more = {"mixed.ply", "quads.ply"}
    for name, data in fuzzing.originals():
        path = tmp_path / name
        path.write_bytes(data)
        mesh = load_mesh(path)
        if name in more:
            assert len(mesh.faces) > len(f)
            continue
        copies = 2 if name in twice else 1
        assert len(mesh.faces) == copies * len(f), name
        assert mesh.area == pytest.approx(copies * area, rel=1e-5), name


def test_a_cut_anywhere_is_refused_by_every_format_that_counts(
    fuzzing, tmp_path
) -> None:
    """Every length of the file, not only chance ones."""
    for name, data in fuzzing.originals():
        if name not in ("little.ply", "binary.stl", "two.glb", "text.stl", "plain.off"):
            continue
        step = 97 if len(data) > 4000 else 29
        stop = len(data.rstrip(b"\n")) - len("endsolid ball")
        for at in range(0, stop, step):
            path = tmp_path / name
            path.write_bytes(data[:at])
            with pytest.raises(MeshError):
                load_mesh(path)


@pytest.mark.long
def test_the_worker_is_restarted_when_it_dies_or_hangs(
    fuzzing, tmp_path, monkeypatch
) -> None:
    script = tmp_path / "frail.py"
    script.write_text(
        "import os, sys, time\n"
        "for line in sys.stdin:\n"
        "    n = int(line.split()[1])\n"
        "    if n == 1: os.abort()\n"
        "    if n == 2: time.sleep(60)\n"
        "    print('{\"read\": false}', flush=True)\n"
    )
    monkeypatch.setattr(fuzzing, "SECONDS", 3.0)
    worker = fuzzing.Worker(script)
    answers = [worker.ask(0, n) for n in range(4)]
    worker.close()
    assert "died with code -6" in answers[1]["escaped"]
    assert "no answer within 3 s" in answers[2]["escaped"]
    assert answers[0] == answers[3] == {"read": False}
