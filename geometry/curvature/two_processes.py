"""libigl's fit of large meshes in two halves, one of them in a process of its own.

`igl.principal_curvature` takes one thread and doesn't let go of the interpreter, so
threads of this process can't share its work. Each half gets the rings that its rim is
fitted to, so both give what one call gives, bit for bit.
"""

import io
import subprocess
import sys
from contextlib import suppress

import igl
import numpy as np
from numpy.typing import NDArray

from geometry.mesh.topology import numbered
from geometry.parallel import n_threads

# Below, starting a process takes longer than it wins.
_LARGE = 200_000
_CHILD = """
import sys, io, igl, numpy as np
given = io.BytesIO(sys.stdin.buffer.read())
vertices, faces, rings = (np.load(given) for _ in range(3))
found = igl.principal_curvature(vertices, faces, radius=int(rings), useKring=True)
for part in found[:4]:
    np.save(sys.stdout.buffer, np.asarray(part))
np.save(sys.stdout.buffer, np.array(found[4], dtype=np.int64))
"""

Fit = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]


def principal_curvature(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], rings: int
) -> Fit:
    """Return curvatures (2, n), larger first, directions (2, n, 3) and success (n,).

    Args:
        vertices: Each in some face, shape (n, 3).
        faces: Shape (m, 3).
        rings: About each vertex that a quadric is fitted to.
    """
    if len(vertices) < _LARGE or n_threads() < 2 or not sys.executable:
        return _unpacked(_fit(vertices, faces, rings))
    axis = int(np.argmax(np.ptp(vertices, axis=0)))
    low = vertices[:, axis] <= np.median(vertices[:, axis])
    parts = [_with_rim(vertices, faces, own, rings) for own in (low, ~low)]
    child = _started(*parts[1][1:], rings)
    here = _fit(*parts[0][1:], rings)
    there = _answer(child)
    if there is None:
        there = _fit(*parts[1][1:], rings)
    n = len(vertices)
    k, ways, fitted = np.zeros((2, n)), np.zeros((2, n, 3)), np.zeros(n, dtype=bool)
    for own, (used, _, _), found in zip((low, ~low), parts, (here, there), strict=True):
        part_k, part_ways, part_fitted = _unpacked(found)
        mine = own[used]
        k[:, used[mine]] = part_k[:, mine]
        ways[:, used[mine]] = part_ways[:, mine]
        fitted[used[mine]] = part_fitted[mine]
    return k, ways, fitted


_Raw = tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.int64],
]
_Part = tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]


def _fit(vertices: NDArray[np.float64], faces: NDArray[np.int64], rings: int) -> _Raw:
    found = igl.principal_curvature(
        np.ascontiguousarray(vertices), faces, radius=rings, useKring=True
    )
    first, second, k_first, k_second = (np.asarray(part) for part in found[:4])
    return first, second, k_first, k_second, np.array(found[4], dtype=np.int64)


def _unpacked(found: _Raw) -> Fit:
    first, second, k_first, k_second, bad = found
    k, ways = np.stack([k_first, k_second]), np.stack([first, second])
    fitted = np.all(np.isfinite(k), axis=0) & np.all(np.isfinite(ways), axis=(0, 2))
    fitted[bad] = False
    return k, ways, fitted


def _with_rim(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    own: NDArray[np.bool_],
    rings: int,
) -> _Part:
    """The vertices that some are fitted from, their places, and the faces on them."""
    near = own.copy()
    # One ring more, on which the normals of the last one depend.
    for _ in range(rings + 1):
        near[faces[near[faces].any(axis=1)]] = True
    used, local = numbered(faces[near[faces].all(axis=1)], len(vertices))
    return used, vertices[used], local


def _started(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], rings: int
) -> "subprocess.Popen[bytes] | None":
    """A process that fits; None if there can't be one."""
    data = io.BytesIO()
    for part in (vertices, faces, np.array(rings)):
        np.save(data, part)
    try:
        child = subprocess.Popen(
            [sys.executable, "-c", _CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return None
    assert child.stdin is not None
    # What ends without reading is found out when its answer is asked for.
    with suppress(OSError):
        child.stdin.write(data.getbuffer())
    with suppress(OSError):
        child.stdin.close()
    return child


def _answer(child: "subprocess.Popen[bytes] | None") -> _Raw | None:
    if child is None:
        return None
    with child:
        assert child.stdout is not None
        data = io.BytesIO(child.stdout.read())
    if child.returncode != 0:
        return None
    first, second, k_first, k_second, bad = (np.load(data) for _ in range(5))
    return first, second, k_first, k_second, bad
