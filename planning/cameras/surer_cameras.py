"""Other cameras, or more, so that more drawn rigs meet what is asked.

Candidates and what they see are those of the cover, and the same from as near as may
be; the cameras as they stand begin.
Exchanges and additions are taken by what they do to the quantile of drawn rigs' errors
(`pair_errors`), and where that lacks, to what is measured: margins so grow where they
are thin. No proof is made of their number.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.device_stock import within_stock
from planning.proofs.quotas import Quotas, RegionFloors
from planning.scene.bodies.clearance import lacks_clearance, with_clearance
from planning.scene.draws import DRAWS
from planning.scene.measuring.measured import lit_samples
from planning.scene.placed_bodies import blocked_by, bodies_of, moves_bodies
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import one_of_each

from .camera_bodies import lit_among
from .camera_cover import n_fixed
from .pair_errors import PairErrors
from .proved_cameras import CameraStage

# Candidates that are looked at in full: those that lower the mean square most.
_EXCHANGED, _ADDED = 12, 60
# Gains below this share aren't worth another camera, nor another exchange.
_GAIN = 5e-4
# Of the accuracy, kept free beyond what drawn rigs exceed the prediction by.
_RMS_SPARE = 0.005
# Selections that are looked at in full, at most.
_WORK = 20_000
# What is lacking, of the most important first.
_Lack = tuple[int, float]


@dataclass(frozen=True)
class Aim:
    """What cameras are to reach.

    Attributes:
        quantile: Share of drawn rigs.
        rms_m: What the rms error of so many stays below [m]; None: nothing is asked.
        drawn_m: What drawn rigs of the cameras given reach instead [m], which corrects
            what is predicted; None: not known.
        more: Of what is reachable, share that must be measured beyond the present.
        most: Cameras at which it isn't worth it any more; None: no such number.
    """

    quantile: float
    rms_m: float | None
    drawn_m: float | None = None
    more: float = 0.0
    most: int | None = None


def surer_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    cameras: Sequence[PlannedCamera],
    aim: Aim,
    n_candidates: int,
) -> tuple[PlannedCamera, ...]:
    """Return the fewest cameras found that reach the aim, else those that come nearest.

    Beside the candidates of the cover so many from the near end of the shell are tried.
    Existing ones stay, and as much is measured as by the cameras given, of all and of
    every large region.
    """
    scene = scene.among(projectors)
    target = scene.target_samples(DRAWS.surer)
    samples = lit_samples(scene, projectors, target)
    models = one_of_each(stage.cover.candidates.cameras)
    offer = scene.candidates(models)
    near = with_clearance(scene, offer.nearest(n_candidates * len(models)))
    candidates = stage.cover.candidates.joined((*near, *cameras))
    views = candidates.on(samples.target)
    limits = scene.requirements.triangulation
    errors = PairErrors.of(limits, projectors, samples, views)
    first = len(candidates.cameras) - len(cameras)
    start = list(range(first, first + len(cameras)))
    before = errors.measured(start)
    reached = np.any(np.isfinite(errors.sigma), axis=1)
    floors = RegionFloors.of(scene, samples.target, "camera")
    kept = Quotas.of(floors, reached, 0.0, spare=1.0).as_far_as(before)
    total = int(before.sum()) + int(np.ceil(aim.more * reached.sum()))

    def fits(chosen: Sequence[int]) -> bool:
        devices = [candidates.cameras[c] for c in chosen]
        if not within_stock(devices, scene.requirements.stock_of("camera")):
            return False
        if not moves_bodies(devices):
            return True
        bodies, points = bodies_of(devices), samples.target.samples.points
        among = scene.among((*projectors, *devices))
        return (
            not any(lacks_clearance(among, device) for device in devices)
            and bool(
                (lit_among(tuple(projectors), samples, devices) == samples.lit).all()
            )
            and not any(
                blocked_by(
                    bodies, candidates.cameras[c], points[views[c].samples]
                ).any()
                for c in chosen
            )
        )

    if aim.rms_m is not None and aim.drawn_m is not None:
        predicted = errors.of_rigs(start, aim.quantile)
        limit = aim.rms_m * predicted / aim.drawn_m * (1.0 - _RMS_SPARE)
        aim = replace(aim, rms_m=limit)
    search = _Search(
        scene,
        errors,
        Quotas(total, floors, kept.floors),
        aim,
        fits,
        list(range(n_fixed(scene), first)),
        n_fixed(scene),
        min(aim.most or np.inf, scene.requirements.max_cameras or np.inf),
    )
    return tuple(candidates.cameras[c] for c in search.run(start))


@dataclass(eq=False)
class _Search:
    """Exchanges cameras while that helps, adds one where it doesn't suffice.

    In the end those go without which the aim is reached.
    """

    scene: Scene
    errors: PairErrors
    quotas: Quotas
    aim: Aim
    fits: Callable[[Sequence[int]], bool]
    offered: list[int]
    n_existing: int
    most: float
    _done: int = 0
    _squares: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        sigma = self.errors.sigma
        # What isn't measured counts as the worst that is.
        worst = sigma[np.isfinite(sigma)].max(initial=0.0)
        self._squares = np.square(np.minimum(sigma, worst))

    def run(self, chosen: list[int]) -> list[int]:
        """Return cameras by their columns, no fewer than are given."""
        fewest = len(chosen)
        chosen, now = self._exchanged(chosen, self._short(chosen))
        while not self._reached(now) and len(chosen) < self.most:
            more = self._best(chosen, [*self._by_mean(chosen, _ADDED)])
            if more is None or not _gains(more[1], now):
                break
            chosen, now = self._exchanged(*more)
        for c in reversed(chosen[self.n_existing :]):
            others = [other for other in chosen if other != c]
            if len(others) >= fewest and self._short(others) == (0, 0.0):
                chosen = others
        return chosen

    def _short(self, chosen: Sequence[int]) -> _Lack:
        """Samples that lack, then by which share the rms is too large."""
        self.scene.check_cancelled()
        self._done += 1
        lacking = self.quotas.lacking(self.errors.measured(chosen))
        if self.aim.rms_m is None:
            return lacking, 0.0
        found = self.errors.of_rigs(chosen, self.aim.quantile)
        return lacking, max(found / self.aim.rms_m - 1.0, 0.0)

    def _reached(self, now: _Lack) -> bool:
        return self._done >= _WORK or now == (0, 0.0)

    def _exchanged(self, chosen: list[int], now: _Lack) -> tuple[list[int], _Lack]:
        """Exchange one camera after the other until none of them is worth it."""
        k, idle = self.n_existing, self.n_existing
        while idle < len(chosen) and not self._reached(now):
            others = chosen[:k] + chosen[k + 1 :]
            better = self._best(others, self._by_mean(others, _EXCHANGED))
            idle += 1
            if better is not None and _gains(better[1], now):
                added = better[0][-1]
                chosen, now = [*chosen[:k], added, *chosen[k + 1 :]], better[1]
                idle = self.n_existing
            k = k + 1 if k + 1 < len(chosen) else self.n_existing
        return chosen, now

    def _by_mean(self, chosen: Sequence[int], n: int) -> list[int]:
        """Candidates beside those chosen that lower the mean square most."""
        offered = [c for c in self.offered if c not in chosen]
        present = self._squares[:, chosen].min(axis=1, initial=np.inf)
        means = np.minimum(present[:, None], self._squares[:, offered]).sum(axis=0)
        return [offered[i] for i in np.argsort(means, kind="stable")[:n]]

    def _best(
        self, chosen: Sequence[int], offered: Sequence[int]
    ) -> tuple[list[int], _Lack] | None:
        """The best of those chosen with one more; None: none fits."""
        every = [[*chosen, c] for c in offered]
        short = [(self._short(one), one) for one in every]
        for now, one in sorted(short, key=lambda found: found[0]):
            if self.fits(one):
                return one, now
        return None


def _gains(new: _Lack, old: _Lack) -> bool:
    for now, before in zip(new, old, strict=True):
        if now != before:
            return now < before - _GAIN or now == 0.0
    return False
