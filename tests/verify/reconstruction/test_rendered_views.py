"""What cameras see is kept until their pairs are done: it is most of the memory."""

import weakref

import numpy as np
import pytest
from support import reconstruction_rigs as rigs

from geometry.mesh.mesh import TriangleMesh
from planning.verify.reconstruction.render import rendered
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Spent, decode_rendered
from planning.verify.reconstruction.scanner import Scanner

N_CAMERAS = 6


@pytest.fixture(scope="module")
def scanner() -> Scanner:
    """Two projectors and six small cameras before a plate."""
    corners = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * 0.03
    plate = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    lights = [
        rigs.parallel(name, rigs.direction(azimuth, 5.0), 1.05 * plate.radius, 12e-3)
        for name, azimuth in (("P1", -20.0), ("P2", 20.0))
    ]
    two = rigs.two_small_cameras()
    cameras = [two[k % 2] | {"id": f"C{k + 1}"} for k in range(N_CAMERAS)]
    return Scanner.of(rigs.plan_of(plate, lights, cameras))


@pytest.mark.parametrize("threads", [1, 2])
def test_few_views_are_kept_at_a_time(scanner, threads, monkeypatch):
    alive, most, seen = set(), [0], []

    def counted(*args):
        view = cast(*args)
        name = view.camera.id
        alive.add(name)
        weakref.finalize(view, alive.discard, name)
        most[0] = max(most[0], len(alive))
        seen.append(name)
        return view

    cast = rendered.view
    monkeypatch.setattr(rendered, "view", counted)
    told = []
    pairs = decode_rendered(
        *(scanner, scanner, Photometry()),
        seed=0,
        threads=threads,
        spent=Spent(),
        progress=lambda done, n: told.append((done, n)),
    )
    assert sorted(seen) == [camera.id for camera in scanner.cameras]
    assert most[0] < N_CAMERAS
    assert [pair for pair, _ in pairs] == [pair for pair, _ in scanner.pairs()]
    n = 2 * N_CAMERAS
    assert told == [(done, n) for done in range(n + 1)]
