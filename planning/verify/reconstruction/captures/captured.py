"""From images, taken or rendered, to a judged cloud that says what was left out.

Rendered images go the same way as those that are read from files, so that a cloud of
saved images is the one that was made of them before.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.errors import CapturesError
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.check.check import conclude
from planning.verify.reconstruction.check.result import PairCount, Reconstruction
from planning.verify.reconstruction.decode.decode import Decoded, decode
from planning.verify.reconstruction.decode.inspection import DarkError, inspect
from planning.verify.reconstruction.faults.causes import rejection
from planning.verify.reconstruction.patterns.ring_patterns import (
    Frames,
    Images,
    RingPatterns,
    ring_patterns,
)
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import (
    Pairs,
    Progress,
    Spent,
    decode_rendered,
    decoder_limits,
    pair_calibrations,
    reported,
)

from .captures import CaptureFolder, frame_names, whole_image
from .confirm import Confirmed, confirm

_MM = 1e3
# A pair that should measure this share of the target, and gives nothing, is missed.
_MISSED = 0.01


@dataclass(frozen=True, eq=False)
class Expected:
    """What should be measured.

    Attributes:
        samples: Of the target.
        measured: Which of them some pair measures, shape (n,).
        by_pair: Share of them that each pair measures, shape (n_p, n_c).
    """

    samples: SurfaceSamples
    measured: NDArray[np.bool_]
    by_pair: NDArray[np.float64]


def reconstruct_rendered(
    plan: RigPlan,
    expected: Expected,
    *,
    seed: int,
    threads: int = 2,
    truth: RigPlan | None = None,
    believed: RigPlan | None = None,
    photometry: Photometry | None = None,
    save: CaptureFolder | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct from rendered images.

    Args:
        plan: For which the patterns are drawn.
        expected: By the plan.
        seed: Of the pixel noise.
        threads: Worker threads; the result doesn't depend on them.
        truth: What really stands there; the plan by default.
        believed: What the decoder knows of poses and optics; the plan by default.
        photometry: Simulated light and sensor.
        save: Where the images are written; None: nowhere.
        progress: Called with the pairs done and their total.

    Raises:
        OSError: If the images can't be written.
    """
    light, spent = photometry or Photometry(), Spent()
    desk = _Desk(plan)

    def develop(p: int, c: int, frames: Frames) -> Frames | None:
        stack = whole_image(frames, plan.cameras[c].device.resolution)
        if save is not None:
            save.write(p, c, stack.astype(np.uint8))
        return desk.inspected(p, c, lambda: stack)

    pairs = decode_rendered(
        plan,
        truth or plan,
        light,
        seed=seed,
        threads=threads,
        spent=spent,
        progress=progress,
        believed=believed,
        develop=develop,
    )
    return _concluded(
        believed or plan,
        pairs,
        desk,
        expected,
        spent,
        threads=threads,
        photometry=light,
    )


def reconstruct_captured(
    folder: CaptureFolder,
    expected: Expected,
    *,
    believed: RigPlan | None = None,
    threads: int = 2,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct from images that cameras took.

    A pair whose images can't be read, or contradict each other, is left out and said
    to be; so is one whose points nothing confirms.

    Args:
        folder: The images, and the plan for which the patterns were drawn.
        expected: By the plan.
        believed: What was measured of poses and optics; the plan by default.
        threads: Worker threads; the result doesn't depend on them.
        progress: Called with the pairs done and their total.

    Raises:
        CapturesError: If the images of no pair can be used.
    """
    folder.require()
    plan, spent = folder.plan, Spent()
    desk = _Desk(plan)
    known, limits = pair_calibrations(believed or plan), decoder_limits(plan)

    def measure(pair: tuple[int, int]) -> Decoded:
        p, c = pair
        with spent.on("decode"):
            frames = desk.inspected(p, c, lambda: folder.read(p, c))
            if frames is None:
                return Decoded.nothing()
            return decode(frames, desk.patterns(p, c), known[p, c], **limits)

    with ThreadPoolExecutor(threads) as pool:
        done = list(reported(pool.map(measure, known), len(known), progress))
    pairs = list(zip(known, done, strict=True))
    desk.require_some()
    return _concluded(believed or plan, pairs, desk, expected, spent, threads=threads)


class _Desk:
    """Where the images of each pair are looked at on their way to the decoder.

    Attributes:
        refused: Why the images of a pair aren't used, in words.
        dark: Likewise, of pairs without light.
        notes: What was left out of the images of a pair.
    """

    def __init__(self, plan: RigPlan) -> None:
        self._plan = plan
        self._cameras = [calibrate_camera(camera) for camera in plan.cameras]
        self._projectors = [calibrate_projector(one) for one in plan.projectors]
        self.refused: dict[tuple[int, int], str] = {}
        self.dark: dict[tuple[int, int], str] = {}
        self.notes: dict[tuple[int, int], tuple[str, ...]] = {}

    def patterns(self, p: int, c: int) -> RingPatterns:
        """Return what a projector drew, as a camera's decoder knows it."""
        radii = self._plan.projectors[p].ring_radii
        return ring_patterns(self._projectors[p], radii, self._cameras[c])

    def inspected(self, p: int, c: int, read: Callable[[], Images]) -> Frames | None:
        """Return what may be decoded of a pair's images; None: nothing."""
        try:
            names = frame_names(self._plan, p, c)
            found = inspect(read(), self.patterns(p, c), names)
        except DarkError as error:
            self.dark[p, c] = str(error)
        except CapturesError as error:
            self.refused[p, c] = str(error)
        else:
            self.notes[p, c] = found.notes
            return found.frames
        return None

    def require_some(self) -> None:
        """Refuse a folder of which no image is used.

        Raises:
            CapturesError: With the reason of the first pair.
        """
        if self.notes or not (self.refused or self.dark):
            return
        (p, c), why = min((self.refused or self.dark).items())
        others = len(self.refused) + len(self.dark) - 1
        more = f"; the other {others} pairs can't be used either" if others else ""
        raise CapturesError(f"{self.name(p, c)}: {why}{more}")

    def name(self, p: int, c: int) -> str:
        """Return what a pair is called."""
        return f"{self._plan.projectors[p].id} with {self._plan.cameras[c].id}"

    def sentences(
        self, pairs: Pairs, confirmed: Confirmed, expected: Expected
    ) -> tuple[str, ...]:
        """Return a sentence for each reason for which the cloud is smaller."""
        found: list[str] = []
        for (p, c), pair in pairs:
            share = float(expected.by_pair[p, c])
            for why in self._reasons(p, c, pair, confirmed, share):
                found.append(f"{self.name(p, c)}: {why}")
        if confirmed.by_each_other:
            found.append(
                "the pairs agree with each other, but not with the mesh of the plan: "
                "the object differs from it, or stands elsewhere"
            )
        return tuple(found)

    def _reasons(
        self, p: int, c: int, pair: Decoded, confirmed: Confirmed, share: float
    ) -> list[str]:
        should = f"it should measure {share:.0%} of the target"
        if (p, c) in self.refused:
            return [f"left out: {self.refused[p, c]}"]
        if (p, c) in self.dark:
            dark = f"left out: {self.dark[p, c]} ({should})"
            return [dark] if share >= _MISSED else []
        found = list(self.notes.get((p, c), ()))
        if (p, c) in confirmed.errors_m:
            found.append(
                f"left out: its points lie {_MM * confirmed.errors_m[p, c]:.3g} mm off "
                f"the mesh (median), and no other pair confirms them: images of other "
                f"devices, or exchanged, or poses that aren't those of the plan or the "
                f"calibration"
            )
        elif (p, c) in confirmed.strays:
            found.append(
                f"{confirmed.strays[p, c]} of its {len(pair.cloud)} points are left "
                f"out: far off the mesh, and no other pair confirms them"
            )
        elif not len(pair.cloud) and (share >= _MISSED or pair.rejected.get("labels")):
            count = _count(pair)
            why = rejection((count,)) or "no ring edge was decoded"
            found.append(f"gave no point: {why} ({should})")
        return found


def _count(pair: Decoded) -> PairCount:
    return PairCount(
        "", "", pair.lit_pixels, pair.n_edges, len(pair.cloud), pair.rejected
    )


def _concluded(
    plan: RigPlan,
    pairs: Pairs,
    desk: _Desk,
    expected: Expected,
    spent: Spent,
    *,
    threads: int,
    photometry: Photometry | None = None,
) -> Reconstruction:
    """Leave out what nothing confirms, merge, judge, and say what is missing."""
    confirmed = confirm(
        pairs,
        plan.surface.mesh,
        [calibrate_camera(camera) for camera in plan.cameras],
        limit_m=plan.requirements.check.max_rms_m,
        threads=threads,
    )
    found = conclude(
        plan,
        confirmed.pairs,
        seed=0,
        threads=threads,
        samples=expected.samples,
        predicted=expected.measured,
        photometry=photometry,
        seconds=spent.seconds,
    )
    sentences = desk.sentences(pairs, confirmed, expected)
    return replace(found, failures=sentences + found.failures)
