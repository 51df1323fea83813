"""Which pairs of projector and camera measure a sample, and what a loss leaves of them.

A sample is measured K-fold by a set of devices if at least K different pairs among them
measure it. With M the pairs that measure it, the loss of any one device leaves K iff::

    min over devices d of |{(p, c) in M : p != d and c != d}| >= K

For K = 1 that is two pairs that share no device: M is a bipartite graph, no single node
meets all its edges iff it has a matching of two (Koenig 1931, "Grafok es matrixok").
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera

from .camera_views import CameraView, camera_views
from .measured import LitSamples, pairs_of, taken
from .scene import Scene

_Mask = NDArray[np.bool_]


def measuring_pairs(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    lit: LitSamples,
    views: Sequence[CameraView] | None = None,
) -> _Mask:
    """Return which pair measures which lit sample, shape (n, n_cameras, n_projectors).

    `views` are those of the cameras on the lit samples, where they are at hand.
    """
    if views is None:
        views = camera_views(scene, cameras, lit.target)
    limits = scene.requirements.triangulation
    pairs = np.zeros((len(lit.target), len(cameras), len(lit.lights)), dtype=bool)
    for c, seen in enumerate(views):
        scene.check_cancelled()
        for pair in pairs_of(limits, lit, seen.view, samples=seen.samples):
            pairs[pair.samples[pair.measured], c, pair.projector] = True
    return pairs


def pair_counts(pairs: _Mask, without: int | None = None) -> NDArray[np.uint8]:
    """Return with how many projectors each camera measures each sample, (n, n_cameras).

    `without` is a projector that is lost.
    """
    counts = pairs.sum(axis=2, dtype=np.uint8)
    return counts if without is None else counts - pairs[:, :, without]


def measured_fold(pairs: _Mask, views: int) -> _Mask:
    """Return which samples at least so many pairs measure, shape (n,)."""
    return np.asarray(pairs.sum(axis=(1, 2)) >= views)


def without_projector(pairs: _Mask, p: int) -> _Mask:
    """Return the pairs that are left without a projector."""
    return np.delete(pairs, p, axis=2)


def without_camera(pairs: _Mask, c: int) -> _Mask:
    """Return the pairs that are left without a camera."""
    return np.delete(pairs, c, axis=1)


def reachable_fold(
    scene: Scene,
    cameras: Sequence[PlannedCamera],
    samples: LitSamples,
    pairs: _Mask,
    views: int,
    *,
    survive: bool,
) -> _Mask:
    """Return what reference cameras could measure K-fold, shape (n, 1 + n_projectors).

    Of lit samples with the pairs (n, k, n_projectors) that measure them already: with
    all projectors, then without each of them if one may be lost. One reference camera
    after the other is asked for what is still missing.
    """
    n_projectors = pairs.shape[2]
    found = pairs.sum(axis=1, dtype=np.int64)
    lost = np.zeros((1 + n_projectors, n_projectors), dtype=bool)
    lost[1:] = np.eye(n_projectors, dtype=bool)
    lost = lost if survive else lost[:1]

    def reached() -> _Mask:
        return found @ ~lost.T >= views

    # What no pair can add to isn't asked for: unlit without a projector.
    able = samples.lit @ ~lost.T > 0
    for camera in cameras:
        pending = np.flatnonzero(np.any(able & ~reached(), axis=1))
        if not len(pending):
            break
        others = taken(samples, pending, samples.lit)
        found[pending] += measuring_pairs(scene, [camera], others)[:, 0]
    return np.asarray(reached())
