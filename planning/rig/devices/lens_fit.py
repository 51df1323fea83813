"""Which optics fit an object: by the formulas that the rig's own are computed with."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from geometry.devices import DeviceModel, ParallelModel
from planning.model.errors import InfeasibleLimitsError
from planning.model.words import percent
from planning.rig import optics
from planning.rig.object_size import ObjectSize
from planning.rig.rig_tables import ParallelTable, PinholeTable

# One view of an object that takes more images side by side is refused: candidates grow
# with their number, and a plan would take hours.
_MOST_IMAGES = 64
# Few lenses stop down further.
_LARGEST_STOP = 22.0
# Below this share of the image a longer lens is worth a word.
_LEAST_SHARE = 0.1
# Optics are scaled by at most so much either way, in so many steps and halvings.
_LONGEST, _STEPS, _HALVINGS = 1e3, 200, 40
# Diffraction blurs by this much times the f-number [m]: `docs/reference/rig-files.md`.
_DIFFRACTION_M = 0.55e-6


@dataclass(frozen=True)
class Focus:
    """A lens set so that a range of depths is sharp, with the least f-number."""

    focal_m: float
    f_number: float
    distance_m: float
    diffraction_px: float


@dataclass(frozen=True, eq=False)
class LensFit:
    """A device of a rig, a standoff away from an object of some size.

    Attributes:
        role: `camera` or `projector`.
        table: The device as written.
        device: Its optics.
        standoff_m: Distance from the surface [m].
        play_m: How much nearer or farther it may stand [m].
        size: Of the object.
    """

    role: str
    table: PinholeTable | ParallelTable
    device: DeviceModel
    standoff_m: float
    play_m: float
    size: ObjectSize

    @property
    def called(self) -> str:
        """What sentences call it: the camera, or of a list camera 2."""
        return f"the {self.role}" if self.role.isalpha() else self.role

    @property
    def radius_m(self) -> float:
        """Radius of the smallest ball that holds the object [m]."""
        return self.size.radius_m

    @property
    def middle_m(self) -> float:
        """Distance from the object's centre [m]."""
        return self.standoff_m + self.radius_m

    @property
    def field_m(self) -> tuple[float, float]:
        """Width and height of the field at the standoff [m]."""
        width, height = (2.0 * self.device.half_rectangle(self.standoff_m)).tolist()
        return width, height

    @property
    def images(self) -> int:
        """Images side by side that one view of the whole object takes."""
        if self.device.holds_ball(self.radius_m, self.middle_m):
            return 1
        long, short = self.size.sides_m
        fields = self.field_m, self.field_m[::-1]
        return min(
            max(math.ceil(long / width), 1) * max(math.ceil(short / height), 1)
            for width, height in fields
        )

    @property
    def share(self) -> float:
        """Share of the image that the object fills, mean over all directions.

        Its shadow S at the distance d of its centre, of pixels of the side p(d)::

            S / (p^2 w h),   1 at most
        """
        width, height = self.device.resolution
        filled = self.size.shadow_m2 / (
            self.device.pixel_m(self.middle_m) ** 2 * width * height
        )
        return min(1.0, filled)

    @property
    def depths_m(self) -> tuple[float, float]:
        """Nearest and farthest depth that faces the device: to the object's centre."""
        near = max(self.standoff_m - self.play_m, 1e-9)
        return near, self.middle_m + self.play_m

    @property
    def is_sharp(self) -> bool:
        """Whether all of these depths are sharp."""
        (near, far), (low, high) = self.depths_m, self.device.range_m
        return low <= near and far <= high

    @cached_property
    def fitting(self) -> DeviceModel | None:
        """The same device with the longest lens that shows all of the object, sharp.

        The ball touches the nearest edge of the image; in parallel light, the finest
        pixels whose panel is as wide as the ball. None: no lens with this shift does.
        """
        if isinstance(self.device, ParallelModel):
            panel, beam = float(self.device.half_panel.min()), self.device.beam_radius
            factor = self.radius_m / min(panel, self.device.beam_reach)
            return replace(
                self.device,
                pixel_pitch_m=factor * self.device.pixel_pitch_m,
                beam_radius=None if beam is None else factor * beam,
            )
        low, high = 1.0, 1.0
        # A shifted image narrows again where it is very wide: from the long end on.
        for factor in np.geomspace(_LONGEST, 1.0 / _LONGEST, _STEPS).tolist():
            low, high = factor, low
            if self._shows_all(low):
                break
        else:
            return None
        for _ in range(_HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self._shows_all(middle) else (low, middle)
        if self.pixel_m is not None:
            blur_m = self._blur_px * self.pixel_m
            sharp = optics.longest_sharp(_LARGEST_STOP, blur_m, *self.depths_m)
            low = min(low, sharp / (self.device.focal_px * self.pixel_m))
        return self._scaled(low)

    def _shows_all(self, factor: float) -> bool:
        return self._scaled(factor).holds_ball(self.radius_m, self.middle_m)

    @property
    def standoff_that_holds_m(self) -> float | None:
        """Least standoff at which this lens shows all of the object; None: at any.

        With the least half angle a of the image, R / sin(a) - R.
        """
        if isinstance(self.device, ParallelModel):
            return None
        return self.radius_m / math.sin(self.device.half_angle) - self.radius_m

    def focused(self, device: DeviceModel) -> Focus | None:
        """Return how a lens is set to be sharp over the depths; None: pixels unknown.

        With the depths n to r, the circle of confusion c of the rig file and the focal
        length f, from both formulas of `optics.depth_of_field`::

            s = 2 n r / (n + r),   N = f^2 (r - n) / (c (s - f) (r + n))
        """
        pixel_m, blur_px = self.pixel_m, self._blur_px
        if pixel_m is None or isinstance(device, ParallelModel):
            return None
        focal, (near, far) = device.focal_px * pixel_m, self.depths_m
        if not near > focal:
            return None
        stop, distance = optics.least_stop(focal, blur_px * pixel_m, near, far)
        return Focus(focal, stop, distance, _DIFFRACTION_M * stop / pixel_m)

    def focused_at_none(self, device: DeviceModel) -> bool:
        """Whether the nearest depth has no image: the focal length is known, longer."""
        if self.pixel_m is None or isinstance(device, ParallelModel):
            return False
        return device.focal_px * self.pixel_m >= self.depths_m[0]

    @property
    def pixel_m(self) -> float | None:
        """Pixel pitch on sensor or panel [m], if the rig file gives it."""
        if isinstance(self.table, ParallelTable) or self.table.pixel_um is None:
            return None
        return 1e-6 * self.table.pixel_um

    @property
    def _blur_px(self) -> float:
        focus = None if isinstance(self.table, ParallelTable) else self.table.focus
        return 1.0 if focus is None else focus.blur_px

    def _scaled(self, factor: float) -> DeviceModel:
        """The device with another focal length: a shifted lens keeps its shift."""
        assert not isinstance(self.device, ParallelModel)
        matrix = self.device.camera_matrix.copy()
        matrix[[0, 1], [0, 1]] *= factor
        return replace(self.device, camera_matrix=matrix)

    def lens_words(self, device: DeviceModel) -> str:
        """Return a lens by the figures that data sheets give, without its focus."""
        if isinstance(device, ParallelModel):
            return f"pixels of {1e3 * device.pixel_pitch_m:.3g} mm"
        words: list[str] = []
        if self.pixel_m is not None:
            words.append(f"a lens of {1e3 * device.focal_px * self.pixel_m:.3g} mm")
        if self.role == "projector":
            ratio = device.focal_px / device.resolution[0]
            words.append(f"a throw ratio of {ratio:.3g}")
        return ", ".join(words or [f"a lens of {device.focal_px:.0f} px"])

    def advice(self) -> str:
        """Return which lens shows all of the object, set how; or that none does."""
        if self.fitting is None:
            return "no lens with this shift shows all of it from there"
        return (
            f"{self.lens_words(self.fitting)} would show all of it, "
            f"{self.focus_words(self.fitting)}"
        )

    def focus_words(self, device: DeviceModel) -> str:
        """Return how a lens is set to be sharp over the depths."""
        near, far = (f"{1e3 * depth:.0f}" for depth in self.depths_m)
        focus = self.focused(device)
        if focus is None and self.focused_at_none(device):
            return f"at no focus sharp from {near} mm on, nearer than its focal point"
        if focus is None:
            return f"sharp from {near} to {far} mm"
        blur = f"for {near} to {far} mm at {self._blur_px:g} px of blur"
        if not focus.f_number <= _LARGEST_STOP * (1.0 + 1e-9):
            longest = optics.longest_sharp(
                _LARGEST_STOP, self._blur_px * (self.pixel_m or 0.0), *self.depths_m
            )
            return (
                f"at no stop sharp {blur}: one of {1e3 * longest:.3g} mm is, at "
                f"f/{_LARGEST_STOP:g}"
            )
        faint = focus.diffraction_px
        return (
            f"focused at {1e3 * focus.distance_m:.0f} mm and stopped to "
            f"f/{focus.f_number:.2g} or more {blur}"
            + (f"; diffraction blurs {faint:.1f} px" * (faint > self._blur_px))
        )

    def to_document(self) -> dict[str, Any]:
        """Return plain values in metres: what is, and lenses that would be sharp."""
        lenses = list[dict[str, Any]]()
        for device in filter(None, (self.device, self.fitting)):
            focus = self.focused(device)
            size = (
                {"pixel_pitch_m": device.pixel_pitch_m}
                if isinstance(device, ParallelModel)
                else {"focal_px": device.focal_px}
            )
            lenses.append(size if focus is None else size | asdict(focus))
        return {
            "name": self.table.name,
            "field_m": list(self.field_m),
            "share": self.share,
            "images": self.images,
            "depths_m": list(self.depths_m),
            "range_m": list(self.device.range_m),
            "is_sharp": self.is_sharp,
            "standoff_that_holds_m": self.standoff_that_holds_m,
            "lens": lenses[0],
            "longest_lens": lenses[1] if len(lenses) > 1 else None,
        }


def check_fields(fits: Sequence[LensFit]) -> None:
    """Refuse devices whose field is so small that a plan would take hours.

    Raises:
        InfeasibleLimitsError: It says which lens and which standoff would do.
    """
    for fit in fits:
        if fit.images <= _MOST_IMAGES:
            continue
        across = " x ".join(f"{1e3 * side:.3g}" for side in fit.field_m)
        away = fit.standoff_that_holds_m
        farther = "" if away is None else f", or this one from {1e3 * away:.0f} mm on"
        raise InfeasibleLimitsError(
            f"{fit.called} {fit.table.name} sees {across} mm at the standoff of "
            f"{1e3 * fit.standoff_m:g} mm, and the object is {2e3 * fit.radius_m:.0f} "
            f"mm across: one view of it takes {fit.images} images, {_MOST_IMAGES} at "
            f"most. At that standoff {fit.advice()}{farther}; check the mesh's unit, "
            f"and see `plan lens`"
        )


def optics_notes(fits: Sequence[LensFit]) -> Iterator[str]:
    """Yield what a device's optics leave unused, and what would fit, a line each."""
    for fit in fits:
        if fit.share < _LEAST_SHARE:
            yield (
                f"the object fills {percent(fit.share)} of {fit.called}'s image, and "
                f"a longer lens would use more of it: {fit.advice()}"
            )


def unsharp(fit: LensFit) -> str:
    """Return that a device isn't sharp at the standoff, and what would be."""
    low, high = (f"{1e3 * end:.0f}" for end in fit.device.range_m)
    return (
        f"placement.standoff_mm = {1e3 * fit.standoff_m:g} is outside the distances at "
        f"which {fit.called} is sharp, {low} to {high} mm; move the standoff, or set "
        f"the lens otherwise: {fit.lens_words(fit.device)} "
        f"{fit.focus_words(fit.device)}. `plan lens` says what suits an object"
    )
