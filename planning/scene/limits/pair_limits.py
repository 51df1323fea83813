"""When a pair of projector and camera measures a sample well enough.

With m the unit normal of the surface of equal code, h their spacing along it and r the
viewing ray, |r.m|, s_N and the pitch are those of `measurability`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from planning.model.light.light_budget import SATURATED
from planning.model.requirements import TriangulationLimits
from planning.scene.samples import LightOnSamples

from .camera_limits import CAMERA_LIMITS, ROUNDING, SEEN_CAUSES, ViewedSamples
from .light_terms import GreyLevels
from .limit import (
    Array,
    Limit,
    LimitRelaxation,
    Mask,
    RigFacts,
    causes,
    to_digits,
    to_step,
)

# Of noise in the image, as stated and by the light, of misplaced rings, of the phase and
# of the panel's pixels, s_N; of the calibration, s_C.
Term = Literal["edges", "light", "phase", "rings", "linearity", "camera", "projector"]
TERMS: tuple[Term, ...] = get_args(Term)
NOISE_TERMS: tuple[Term, ...] = ("edges", "light", "phase", "rings", "linearity")

# Beyond these no limit is worth relaxing: first-order errors hold no longer.
_LEAST_CONDITIONING = 0.03
_LEAST_PITCH_PX, _LEAST_ANGLE = 3.0, 3.0
# More or less light by more than this is another rig.
_MOST_LIGHT = 30.0


@dataclass(frozen=True, eq=False)
class PairQuality:
    """How well a pair triangulates n samples.

    Attributes:
        conditioning: |r.m|, shape (n,).
        sigma: What `max_sigma_m` limits: s_N, or sqrt(s_N^2 + s_C^2) [m], shape (n,).
        terms: Independent parts of the deviation along the normal by `TERMS` [m], (n,)
            each; what is stated of none of them is absent.
        pitch: Distance of neighbouring rings in the image in [px], shape (n,).
        view: How the camera sees them: it stands at -t r from a sample.
        light: That falls on them: the projector stands at minus its offsets.
        edge_px: Noise of edges in the image [px], shape (n,).
        drawn_m: How far rings and their edges lie off along m, rms [m], shape (n,).
        grey: How bright they come out; None: nobody says.
        light_cos: Cosine of the angle at which ray and light meet, shape (n,); None: of
            rings, which it says little of.
    """

    conditioning: Array
    sigma: Array
    terms: dict[Term, Array]
    pitch: Array
    view: ViewedSamples
    light: LightOnSamples
    edge_px: Array
    drawn_m: Array
    grey: GreyLevels | None = None
    light_cos: Array | None = None

    @property
    def total(self) -> Array:
        """Root of the sum of the squares of all terms, in [m], shape (n,)."""
        return np.sqrt(sum(np.square(term) for term in self.terms.values()))


@dataclass(frozen=True, eq=False)
class PairCell:
    """The best of one projector with a camera anywhere in a cell of poses, (k,) each.

    |r.m| and |N.r| at most, t |g| at least; s_px in [px], h in [m], and at least what
    moves the surfaces of equal code, times |N.r| [m]. Of coded pixels also the least
    and the largest angle at which ray and light may meet.
    """

    conditioning: Array
    facing: Array
    shift: Array
    noise: Array
    spacing: Array
    placement: Array
    angles: tuple[Array, Array] | None = None


class TooDark(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Lit less dark >= min_contrast, where the surface is darkest."""

    name = "too_dark"
    words = "too dark in the image"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return where lit and dark can be told apart."""
        if view.grey is None or rules.light is None:
            return None
        return view.grey.contrast >= rules.light.min_contrast

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield more light: of the projector, through the lens, or for longer."""
        light = facts.required.triangulation.light
        if light is None:
            return
        least, lumens, number = light.min_contrast, light.lumens, light.f_number
        longest, step = 1e3 * light.max_exposure_s, 1e3 * (light.period_s or 0.0)

        def exposed(times: float) -> float:
            return step * np.ceil(times * longest / step) if step else times * longest

        yield LimitRelaxation(
            self.name,
            lambda pair: _within(least / np.maximum(pair.grey.contrast, 1e-9)),
            to_digits(3),
            lambda times: (
                f"photometry.lumens = {times * lumens:.4g} (now {lumens:g}), "
                f"camera.focus.f_number = {number / times**0.5:.3g} (now {number:g}) "
                f"or photometry.max_exposure_ms = {exposed(times):.4g} (now "
                f"{longest:.3g})"
            ),
        )


class Clipped(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Lit surface below full scale, where it is brightest."""

    name = "clipped"
    words = "too bright for the sensor"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return what doesn't clip."""
        return None if view.grey is None else view.grey.white < SATURATED

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield less light."""
        light = facts.required.triangulation.light
        if light is None:
            return
        lumens, number = light.lumens, light.f_number
        yield LimitRelaxation(
            self.name,
            lambda pair: _within(pair.grey.white / SATURATED),
            to_digits(3),
            lambda times: (
                f"camera.focus.f_number = {number * times**0.5:.3g} (now {number:g}) "
                f"or photometry.lumens = {lumens / times:.4g} (now {lumens:g})"
            ),
        )


def _within(times: Array) -> Array:
    return np.where(times <= _MOST_LIGHT, times, np.inf)


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


class Angle(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Ray and light meet at min_angle to max_angle, of coded pixels."""

    name = "angle"
    words = "where ray and light meet at too small or too large an angle"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return which samples lie between both."""
        if view.light_cos is None:
            return None
        low, high = rules.angles
        return (view.light_cos <= np.cos(low)) & (view.light_cos >= np.cos(high))

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask | None:
        """Return which may, of all angles that a cell leaves."""
        if cell.angles is None:
            return None
        (least, largest), (low, high) = cell.angles, rules.angles
        return (largest >= low - ROUNDING) & (least <= high + ROUNDING)

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a smaller least angle, and a larger largest one."""
        low, high = facts.required.triangulation.angles

        def met(pair: PairQuality) -> Array:
            return np.degrees(np.arccos(np.clip(pair.light_cos, -1.0, 1.0)))

        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(
                (met(pair) >= _LEAST_ANGLE) & (met(pair) < np.degrees(low)),
                -met(pair),
                np.inf,
            ),
            to_step(1.0),
            lambda value: (
                f"limits.min_angle_deg = {-value:.0f} (now {np.degrees(low):g})"
            ),
        )
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(met(pair) > np.degrees(high), met(pair), np.inf),
            to_step(1.0),
            lambda value: (
                f"limits.max_angle_deg = {value:.0f} (now {np.degrees(high):g})"
            ),
        )


class Sigma(Limit[PairQuality, PairCell, TriangulationLimits]):
    """s_N, or with the calibration's s_C sqrt(s_N^2 + s_C^2), <= max_sigma."""

    name = "sigma"
    words = "measured with too large a deviation"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return which samples are measured exactly enough."""
        limit = rules.max_sigma_m
        return None if limit is None else view.sigma <= limit

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask | None:
        """Return which may be, from the least of each term that a cell leaves."""
        limit = rules.max_sigma_m
        if limit is None:
            return None
        edge = np.hypot(cell.noise * cell.shift, cell.placement) * (1.0 - ROUNDING)
        return edge <= limit * np.maximum(cell.conditioning, 1e-12)

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger deviation."""
        limit = facts.required.triangulation.max_sigma_m
        if limit is None:
            return
        yield LimitRelaxation(
            self.name,
            lambda pair: 1e3 * pair.sigma,
            to_digits(3),
            lambda value: f"--accuracy {value:.3g} (now {1e3 * limit:g} mm)",
        )


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
            to_digits(3),
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
