"""When a pair of projector and camera measures a sample well enough.

With m the unit normal of the surface of equal code, h their spacing along it and r the
viewing ray, |r.m|, s_N and the pitch are those of `measurability`.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from planning.model.requirements import TriangulationLimits

from .angle_limit import Angle
from .camera_limits import CAMERA_LIMITS, ROUNDING, SEEN_CAUSES
from .grey_limits import Clipped, TooDark
from .limit import (
    Limit,
    LimitRelaxation,
    Mask,
    RigFacts,
    causes,
    to_step,
    to_three_digits,
)
from .pair_quality import PairCell, PairQuality
from .sigma_limit import MaxSigma

# Beyond these no limit is worth relaxing: first-order errors hold no longer.
_LEAST_CONDITIONING = 0.03
_LEAST_PITCH_PX = 3.0


class Conditioning(Limit[PairQuality, PairCell, TriangulationLimits]):
    """|r.m| >= min_conditioning."""

    name = "conditioning"
    words = "on a blind curve (|r.m| too small)"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask:
        """Return which samples are off the blind curve."""
        return view.conditioning >= rules.min_conditioning

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask:
        """Return which may be, from the largest |r.m|."""
        return cell.conditioning >= rules.min_conditioning - ROUNDING

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a smaller |r.m|."""
        limit = facts.required.triangulation.min_conditioning
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(
                pair.conditioning >= _LEAST_CONDITIONING, -pair.conditioning, np.inf
            ),
            to_step(0.01),
            lambda value: f"limits.min_conditioning = {-value:.2f} (now {limit:g})",
        )


class Sigma(MaxSigma):
    """By a projector and a camera."""

    name = "sigma"
    words = "measured with too large a deviation"

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask | None:
        """Return which may be, from the least of each term that a cell leaves."""
        limit = rules.max_sigma_m
        if limit is None:
            return None
        edge = np.hypot(cell.noise * cell.shift, cell.placement) * (1.0 - ROUNDING)
        return edge <= limit * np.maximum(cell.conditioning, 1e-12)


class Pitch(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Neighbouring rings at least min_ring_pitch apart in the image."""

    name = "pitch"
    words = "with rings too close in the image"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return where rings can be told apart."""
        least = rules.min_ring_pitch_px
        return None if least is None else view.pitch >= least

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask | None:
        """Return where they may be."""
        least = rules.min_ring_pitch_px
        if least is None:
            return None
        return cell.spacing * cell.facing * (1.0 + ROUNDING) >= least * cell.shift

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a wider gap; a smaller limit too where the gap doesn't follow it."""
        least, gap = facts.required.triangulation.min_ring_pitch_px, facts.ring_gap_m
        if least is None:
            return
        chosen = ", chosen" if facts.ring_gap_chosen else ""
        yield LimitRelaxation(
            self.name,
            lambda pair: 1e3 * gap * least / np.maximum(pair.pitch, 1e-12),
            to_three_digits,
            lambda value: f"rings.gap_mm = {value:.3g} (now {1e3 * gap:.3g}{chosen})",
        )
        if facts.ring_gap_chosen:
            return
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(pair.pitch >= _LEAST_PITCH_PX, -pair.pitch, np.inf),
            to_step(0.1),
            lambda value: f"limits.min_ring_pitch_px = {-value:.1f} (now {least:g})",
        )


PAIR_LIMITS: tuple[Limit[Any, Any, Any], ...] = (
    TooDark(),
    Clipped(),
    Conditioning(),
    Angle(),
    Sigma(),
    Pitch(),
)
MEASURED_LIMITS = CAMERA_LIMITS + PAIR_LIMITS
CAUSES = SEEN_CAUSES + causes(PAIR_LIMITS)
MEASURED = len(CAUSES)
