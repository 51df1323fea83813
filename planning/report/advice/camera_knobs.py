"""The limits of a camera that can give way one at a time, and how each is said.

What a sample asks of a limit is a number that grows as the limit gives way: degrees,
millimetres, pixels of blur; of a least value, its negative. A limit that is given is
rounded outwards to what people write, so that what needs it is inside.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.requirements import Requirements
from planning.rig import optics
from planning.rig.rig import Rig
from planning.rig.rig_tables import PinholeTable
from planning.rings.ring_radii import ring_gap
from planning.scene.limits.pair_limits import CAUSES

_Array = NDArray[np.float64]

# Beyond these no limit is worth relaxing: first-order errors hold no longer.
STEEPEST = float(np.radians(85.0))
_LEAST_CONDITIONING = 0.03
_LEAST_PITCH_PX = 3.0
# Two ends of a range agree if they were computed from the same focus [m].
_SAME_M = 1e-6


@dataclass(frozen=True, eq=False)
class Pairs:
    """How a camera and a projector stand to n samples; every array has shape (n,).

    Attributes:
        distances: From camera to sample [m].
        incidence: At the camera [rad].
        off_axis: From the middle of the camera's image [rad].
        sample_distance: z / (f cos(incidence)) [m].
        conditioning: |r.m|.
        sigma: s_N [m].
        pitch: Of neighbouring rings in the image [px].
    """

    distances: _Array
    incidence: _Array
    off_axis: _Array
    sample_distance: _Array
    conditioning: _Array
    sigma: _Array
    pitch: _Array

    def take(self, chosen: NDArray[np.int64]) -> "Pairs":
        """Return some of the samples."""
        return Pairs(*(getattr(self, field.name)[chosen] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A limit that may give way, all others as they are.

    Attributes:
        cause: Index in `CAUSES` of the limit.
        ask: What samples ask of it, more where it must give way farther; inf where it
            is not worth it.
        rounded: Rounds what is asked outwards.
        say: The limit with a rounded value, as a rig file names it.
    """

    cause: int
    ask: Callable[[Pairs], _Array]
    rounded: Callable[[_Array], _Array]
    say: Callable[[float], str]


def knobs(rig: Rig, required: Requirements) -> tuple[Relaxation, ...]:
    """Return every limit of the cameras that binds.

    Args:
        rig: As written: how sharpness and rings came about.
        required: The limits.
    """
    return (
        _incidence(required),
        *_depth(rig),
        _field(),
        *_sampling(required),
        _conditioning(required),
        *_sigma(required),
        *_rings(rig, required),
    )


def _incidence(required: Requirements) -> Relaxation:
    now = np.degrees(required.camera.max_incidence)
    return Relaxation(
        CAUSES.index("camera_incidence"),
        lambda pairs: np.degrees(pairs.incidence),
        _to_step(1.0),
        lambda value: f"limits.camera_max_incidence_deg = {value:.0f} (now {now:g})",
    )


def _depth(rig: Rig) -> tuple[Relaxation, ...]:
    """Sharpness: the blur that is let pass, or else the ends of the range."""
    table, device = rig.table.camera, rig.camera_device()
    allowed = (0.0, np.inf)
    if table.range_mm is not None:
        allowed = 1e-3 * table.range_mm[0], 1e-3 * table.range_mm[1]
    focus = _focus(table, device, allowed)
    # Ends that the focus sets move only with it.
    ends = device.range_m if focus is None else allowed
    return (() if focus is None else (focus,)) + _ends(ends, device.range_m)


def _focus(
    table: PinholeTable, device: PinholeModel, allowed: tuple[float, float]
) -> Relaxation | None:
    """The blur that counts as sharp, where the range follows from it."""
    if table.focus is None or table.pixel_um is None:
        return None
    pixel, at = 1e-6 * table.pixel_um, 1e-3 * table.focus.distance_mm
    focal, number, blur = (
        device.focal_px * pixel,
        table.focus.f_number,
        table.focus.blur_px,
    )
    near, far = optics.depth_of_field(focal, number, blur * pixel, at)
    sharp = max(near, allowed[0]), min(far, allowed[1])
    if not np.allclose(sharp, device.range_m, rtol=0.0, atol=_SAME_M):
        return None

    def ask(pairs: Pairs) -> _Array:
        away = pairs.distances
        circle = optics.blur_diameter(focal, number, at, away) / pixel
        return np.where((away >= allowed[0]) & (away <= allowed[1]), circle, np.inf)

    def say(value: float) -> str:
        stopped = float(_to_digits(3)(np.array(number * value / blur)))
        return (
            f"camera.focus.blur_px = {value:.3g} (now {blur:g}) or "
            f"camera.focus.f_number = {stopped:.3g} (now {number:g})"
        )

    return Relaxation(CAUSES.index("camera_range"), ask, _to_digits(3), say)


def _ends(
    ends: tuple[float, float], sharp: tuple[float, float]
) -> tuple[Relaxation, ...]:
    """The ends of `range_mm`, where these and not the focus bind."""
    cause, found = CAUSES.index("camera_range"), list[Relaxation]()
    near, far = ends
    low, high = 1e3 * sharp[0], 1e3 * sharp[1]
    binds = (near > 0.0 and near >= sharp[0], far < np.inf and far <= sharp[1])
    if binds[0]:
        found.append(
            Relaxation(
                cause,
                lambda pairs: np.where(
                    pairs.distances <= sharp[1], -1e3 * pairs.distances, np.inf
                ),
                _to_step(1.0),
                lambda value: f"a camera sharp from {-value:.0f} mm (now {low:.0f})",
            )
        )
    if binds[1]:
        found.append(
            Relaxation(
                cause,
                lambda pairs: np.where(
                    pairs.distances >= sharp[0], 1e3 * pairs.distances, np.inf
                ),
                _to_step(1.0),
                lambda value: f"a camera sharp to {value:.0f} mm (now {high:.0f})",
            )
        )
    if all(binds):
        found.append(
            Relaxation(
                cause,
                lambda pairs: np.maximum(
                    low - 1e3 * pairs.distances, 1e3 * pairs.distances - high
                ),
                _to_step(1.0),
                lambda value: (
                    f"a camera sharp from {max(low - value, 0.0):.0f} to "
                    f"{high + value:.0f} mm (now {low:.0f} to {high:.0f})"
                ),
            )
        )
    return tuple(found)


def _field() -> Relaxation:
    return Relaxation(
        CAUSES.index("camera_field"),
        lambda pairs: np.degrees(pairs.off_axis),
        _to_step(1.0),
        lambda value: (
            f"a camera image that reaches {value:.0f} degrees off its middle on every "
            f"side"
        ),
    )


def _sampling(required: Requirements) -> tuple[Relaxation, ...]:
    limit = required.camera.max_sample_distance_m
    if limit is None:
        return ()
    return (
        Relaxation(
            CAUSES.index("sample_distance"),
            lambda pairs: 1e3 * pairs.sample_distance,
            _to_digits(3),
            lambda value: (
                f"limits.max_sample_distance_mm = {value:.3g} (now {1e3 * limit:g})"
            ),
        ),
    )


def _conditioning(required: Requirements) -> Relaxation:
    now = required.triangulation.min_conditioning
    return Relaxation(
        CAUSES.index("conditioning"),
        lambda pairs: np.where(
            pairs.conditioning >= _LEAST_CONDITIONING, -pairs.conditioning, np.inf
        ),
        _to_step(0.01),
        lambda value: f"limits.min_conditioning = {-value:.2f} (now {now:g})",
    )


def _sigma(required: Requirements) -> tuple[Relaxation, ...]:
    limit = required.triangulation.max_sigma_m
    if limit is None:
        return ()
    return (
        Relaxation(
            CAUSES.index("sigma"),
            lambda pairs: 1e3 * pairs.sigma,
            _to_digits(3),
            lambda value: f"--accuracy {value:.3g} (now {1e3 * limit:g} mm)",
        ),
    )


def _rings(rig: Rig, required: Requirements) -> tuple[Relaxation, ...]:
    """The gap of the rings; the limit too where the gap doesn't follow from it."""
    limits, cause = required.triangulation, CAUSES.index("pitch")
    limit = limits.min_ring_pitch_px
    if limit is None:
        return ()
    gap = rig.ring_gap_m or ring_gap(
        rig.projector_device(), rig.camera_device(), limits, rig.standoff_m
    )
    said = f"now {1e3 * gap:.3g}" + ("" if rig.ring_gap_m else ", chosen")
    wider = Relaxation(
        cause,
        lambda pairs: 1e3 * gap * limit / np.maximum(pairs.pitch, 1e-12),
        _to_digits(3),
        lambda value: f"rings.gap_mm = {value:.3g} ({said})",
    )
    if rig.ring_gap_m is None:
        return (wider,)
    closer = Relaxation(
        cause,
        lambda pairs: np.where(pairs.pitch >= _LEAST_PITCH_PX, -pairs.pitch, np.inf),
        _to_step(0.1),
        lambda value: f"limits.min_ring_pitch_px = {-value:.1f} (now {limit:g})",
    )
    return (wider, closer)


def _to_step(step: float) -> Callable[[_Array], _Array]:
    return lambda asked: np.ceil(asked / step - 1e-9) * step


def _to_digits(digits: int) -> Callable[[_Array], _Array]:
    """Round positive values up to so many significant digits."""

    def rounded(asked: _Array) -> _Array:
        step = 10.0 ** (np.floor(np.log10(np.maximum(asked, 1e-30))) - digits + 1)
        return np.ceil(asked / step - 1e-9) * step

    return rounded
