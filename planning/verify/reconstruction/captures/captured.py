"""From images, taken or rendered, to a judged cloud that says what was left out.

Rendered images go the same way as those that are read from files, so that a cloud of
saved images is the one that was made of them before.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geometry.parallel import n_threads
from planning.model.errors import CapturesError
from planning.verify.reconstruction.arrays import Images
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import PairCount, Reconstruction
from planning.verify.reconstruction.decode.decode import Decoded, PairIndex, Pairs
from planning.verify.reconstruction.decode.dense.dense_inspection import inspect_dense
from planning.verify.reconstruction.decode.inspection import DarkError, inspect
from planning.verify.reconstruction.faults.measured_clouds import rejection
from planning.verify.reconstruction.faults.refine import refine, remeasured
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera
from planning.verify.reconstruction.reconstruct import conclude
from planning.verify.reconstruction.render.photometry import Photometry, assumed_light
from planning.verify.reconstruction.render.rendered import (
    Progress,
    Spent,
    decode_pair,
    decode_rendered,
    over_pairs,
)
from planning.verify.reconstruction.scanner import Scanner

from .captures import CaptureFolder, whole_image
from .confirm import Confirmed, confirm

# A pair that should measure this share of the target, and gives nothing, is missed.
_MISSED = 0.01


def reconstruct_rendered(
    plan: Scanner,
    expected: Expected,
    *,
    seed: int,
    threads: int | None = None,
    truth: Scanner | None = None,
    believed: Scanner | None = None,
    photometry: Photometry | None = None,
    save: CaptureFolder | None = None,
    mend: bool = False,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct from rendered images.

    Args:
        plan: For which the patterns are drawn.
        expected: By the plan.
        seed: Of the pixel noise.
        threads: Worker threads; no result depends on them. None: all cores.
        truth: What really stands there; the plan by default.
        believed: What the decoder knows of poses and optics; the plan by default.
        photometry: Simulated light and sensor; None: as the plan's check assumes.
        save: Where the images are written; None: nowhere.
        mend: Whether the rig is refined over the edges first.
        progress: Called with the pairs done and their total.

    Raises:
        OSError: If the images can't be written.
        InputError: If a dense rig is to be mended.
    """
    if mend:
        plan.require_rings("--refine")
    threads = threads or n_threads()
    light, spent = photometry or assumed_light(plan), Spent()
    inspection = _Inspection(plan)

    def develop(p: int, c: int, frames: Frames) -> Frames | None:
        stack = whole_image(frames, plan.cameras[c].resolution)
        if save is not None:
            save.write(p, c, stack.astype(np.uint8))
        return inspection.frames((p, c), lambda: stack)

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
    found = _concluded(plan, believed, pairs, inspection, expected, spent, mend)
    return replace(found, photometry=light)


def reconstruct_captured(
    folder: CaptureFolder,
    expected: Expected,
    *,
    believed: Scanner | None = None,
    mend: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct from images that cameras took.

    A pair whose images can't be read, or contradict each other, is left out and said
    to be; so is one that the others contradict.

    Args:
        folder: The images, and the plan for which the patterns were drawn.
        expected: By the plan.
        believed: What was measured of poses and optics; the plan by default.
        mend: Whether the rig is refined over the edges first.
        threads: Worker threads; no result depends on them. None: all cores.
        progress: Called with the pairs done and their total.

    Raises:
        CapturesError: If the images of no pair can be used.
        InputError: If a dense rig is to be mended.
    """
    if mend:
        folder.plan.require_rings("--refine")
    folder.require()
    plan, spent = folder.plan, Spent()
    inspection = _Inspection(plan)
    known = dict((believed or plan).pairs())

    def measure(pair: PairIndex) -> Decoded:
        with spent.on("decode"):
            frames = inspection.frames(pair, lambda: folder.read(*pair))
            if frames is None:
                return Decoded.nothing()
            patterns = inspection.patterns(pair)
            return decode_pair(frames, patterns, known[pair], plan.limits)

    pairs = over_pairs(plan, measure, threads=threads or n_threads(), progress=progress)
    inspection.require_some()
    return _concluded(plan, believed, pairs, inspection, expected, spent, mend)


class _Inspection:
    """What the images of each pair are found to be on their way to the decoder."""

    def __init__(self, plan: Scanner) -> None:
        self._plan = plan
        self._refused: dict[PairIndex, CapturesError] = {}
        self._notes: dict[PairIndex, tuple[str, ...]] = {}

    def patterns(self, pair: PairIndex) -> RingsForCamera:
        """Return what a projector drew, as a camera's decoder knows it."""
        p, c = pair
        return self._plan.projectors[p].pattern_for(self._plan.cameras[c])

    def frames(self, pair: PairIndex, read: Callable[[], Images]) -> Frames | None:
        """Return what may be decoded of a pair's images; None: nothing."""
        try:
            names = self._plan.frame_names(*pair)
            frames, self._notes[pair] = self._inspected(pair, read(), names)
        except CapturesError as error:
            self._refused[pair] = error
            return None
        return frames

    def _inspected(
        self, pair: PairIndex, stack: Images, names: tuple[str, ...]
    ) -> tuple[Frames, tuple[str, ...]]:
        dense = self._plan.projectors[pair[0]].dense
        if dense is not None:
            return inspect_dense(stack, dense, names)
        return inspect(stack, self.patterns(pair), names)

    def require_some(self) -> None:
        """Refuse a folder of which no image is used.

        Raises:
            CapturesError: With the reason of the first pair, darkness last.
        """
        if self._notes or not self._refused:
            return
        pair, why = min(
            self._refused.items(),
            key=lambda one: (isinstance(one[1], DarkError), one[0]),
        )
        others = len(self._refused) - 1
        more = f"; the other {others} pairs can't be used either" if others else ""
        raise CapturesError(f"{self._plan.name(pair)}: {why}{more}")

    def remarks(self) -> tuple[str, ...]:
        """Return a sentence for each reason why pixels of a pair were left out."""
        return tuple(
            f"{self._plan.name(pair)}: {why}"
            for pair, reasons in sorted(self._notes.items())
            for why in reasons
        )

    def sentences(
        self, pairs: Pairs, confirmed: Confirmed, expected: Expected
    ) -> tuple[str, ...]:
        """Return a sentence for each reason for which the cloud is smaller."""
        assert expected.by_pair is not None
        reasons = [
            f"{self._plan.name(pair)}: {why}"
            for pair, decoded in pairs
            if (why := self._reason(pair, decoded, confirmed, expected.by_pair[pair]))
        ]
        return (*reasons, confirmed.remark) if confirmed.remark else tuple(reasons)

    def _reason(
        self, pair: PairIndex, decoded: Decoded, confirmed: Confirmed, share: float
    ) -> str | None:
        should = f"it should measure {share:.0%} of the target"
        refused = self._refused.get(pair)
        if isinstance(refused, DarkError):
            return f"left out: {refused} ({should})" if share >= _MISSED else None
        if refused is not None:
            return f"left out: {refused}"
        if pair in confirmed.reasons:
            return confirmed.reasons[pair]
        if len(decoded.cloud) or not (
            share >= _MISSED or decoded.rejected.get("labels")
        ):
            return None
        count = PairCount.of(self._plan, pair, decoded)
        why = rejection((count,)) or "nothing was decoded"
        return f"gave no point: {why} ({should})"


def _concluded(
    plan: Scanner,
    believed: Scanner | None,
    pairs: Pairs,
    inspection: _Inspection,
    expected: Expected,
    spent: Spent,
    mend: bool,
) -> Reconstruction:
    """Leave out what others contradict, merge, judge, and say what is missing.

    The rig is mended first, if asked, and the edges are measured with it again.
    """
    rig = believed or plan
    refined = refine(rig, pairs) if mend else None
    if refined is not None:
        rig = refined.scanner
        pairs = remeasured(plan, rig, pairs)
    confirmed = confirm(pairs, rig)
    result = conclude(rig, confirmed.pairs, seed=0, expected=expected, spent=spent)
    sentences = inspection.sentences(pairs, confirmed, expected)
    return replace(
        result,
        failures=sentences + result.failures,
        remarks=inspection.remarks(),
        refined=refined,
    )
