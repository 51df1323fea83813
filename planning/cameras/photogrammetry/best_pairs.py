"""Which pair of cameras measures each sample best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera
from planning.scene.measuring.camera_views import camera_views
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .measured_views import view_pairs
from .view_pairs import Sightings, ViewTerm

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BestPairs:
    """Of n samples the pair of least deviation, of those that keep every limit.

    Attributes:
        sigma: Its deviation along the normal, all terms [m], (n,); inf: no pair does.
        terms: Of that pair, (n,) each [m].
    """

    sigma: _Array
    terms: dict[ViewTerm, _Array]


def best_pairs(
    scene: Scene, cameras: Sequence[PlannedCamera], target: Target
) -> BestPairs:
    """Return the pair of least deviation of each sample."""
    n = len(target)
    views = camera_views(scene, cameras, target)
    sightings = Sightings.of(views, target.samples.normals)
    least, terms = np.full(n, np.inf), dict[ViewTerm, _Array]()
    for pair in view_pairs(scene, sightings, len(cameras)):
        total = np.where(pair.measured, pair.quality.total, np.inf)
        # A sample may stand there with several of the cameras before.
        order = np.lexsort((total, pair.samples))
        first = order[np.flatnonzero(np.diff(pair.samples[order], prepend=-1))]
        better = first[total[first] < least[pair.samples[first]]]
        rows = pair.samples[better]
        least[rows] = total[better]
        for name, term in pair.quality.terms.items():
            terms.setdefault(name, np.zeros(n))[rows] = term[better]
    return BestPairs(least, terms)


def widest_sample(
    scene: Scene, cameras: Sequence[PlannedCamera], target: Target
) -> float:
    """Return the largest z / (f cos(incidence)) of samples in cameras' views [m]."""
    widest = 0.0
    for camera, view in zip(cameras, camera_views(scene, cameras, target), strict=True):
        ahead = camera.world_from_device[:3, 2]
        depth = view.view.distances * (view.view.rays @ ahead)
        size = depth / (camera.device.focal_px * np.maximum(view.view.facing, 1e-9))
        widest = max(widest, float(size.max(initial=0.0)))
    return widest
