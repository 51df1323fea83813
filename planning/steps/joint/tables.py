"""What devices on offer light, and how well their pairs measure, on some samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import CameraView, camera_views
from planning.scene.measuring.measured import LitSamples, pairs_of
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .slack import light_slack, pair_slack

_Mask = NDArray[np.bool_]
_Slack = NDArray[np.float32]
# Seen by several cameras and worked on together.
_PAIRS = 8192


@dataclass(frozen=True, eq=False)
class JointTables:
    """Devices on offer, on samples.

    Attributes:
        scene: Surface and requirements.
        target: The samples.
        projectors: On offer, n_p of them.
        cameras: On offer, n_c of them.
        lit: Which projector lights which sample, shape (n, n_p).
        slack: Of each pair on each sample, -inf where it doesn't measure it, shape
            (n, n_c, n_p).
    """

    scene: Scene
    target: Target
    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    lit: _Mask
    slack: NDArray[np.float32]

    @classmethod
    def of(
        cls,
        scene: Scene,
        target: Target,
        projectors: Sequence[PlannedProjector],
        cameras: Sequence[PlannedCamera],
    ) -> "JointTables":
        """Look at samples with every pair."""
        lit = lit_stages(scene, projectors, target) == LIT
        samples = LitSamples.of(projectors, target, lit)
        views = camera_views(scene, cameras, target)
        slack = _slack(scene, samples, views)
        return cls(scene, target, tuple(projectors), tuple(cameras), lit, slack)

    def best(self, projectors: Sequence[int], cameras: Sequence[int]) -> _Slack:
        """Return the slack of each sample by its best pair, -inf for none, (n,)."""
        if not (len(projectors) and len(cameras)):
            return np.full(len(self.lit), -np.inf, dtype=np.float32)
        some = self.slack[:, list(cameras)][:, :, list(projectors)]
        return some.max(axis=(1, 2))

    @property
    def pairs(self) -> _Mask:
        """Which pair measures which sample, shape (n, n_c, n_p)."""
        return np.isfinite(self.slack)


def _slack(
    scene: Scene, samples: LitSamples, views: Sequence[CameraView]
) -> NDArray[np.float32]:
    """Return the slack of every pair of a camera, by its view, with a projector."""
    required = scene.requirements
    shape = len(samples.target), len(views), len(samples.lights)
    slack = np.full(shape, -np.inf, dtype=np.float32)
    lights = [light_slack(light, required.projector) for light in samples.lights]
    ends = np.cumsum([len(view.samples) for view in views])
    starts = np.flatnonzero(np.diff(ends // _PAIRS, prepend=-1))
    for first, last in pairwise([*starts.tolist(), len(views)]):
        scene.check_cancelled()
        some = views[first:last]
        column = np.repeat(np.arange(first, last), [len(s.samples) for s in some])
        seen = CameraView.joined(some)
        for pair in pairs_of(
            required.triangulation, samples, seen.view, samples=seen.samples
        ):
            found = pair_slack(pair.quality, required.triangulation, required.camera)
            found = np.minimum(found, lights[pair.projector][pair.samples])
            good = pair.measured
            rows, columns = pair.samples[good], column[pair.places[good]]
            slack[rows, columns, pair.projector] = found[good]
    return slack
