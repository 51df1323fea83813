"""Images of a rig's cameras by Mitsuba 3's path tracer, decoded as any others."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from scipy.ndimage import gaussian_filter

from planning.model.errors import InputError
from planning.verify.reconstruction.arrays import Grey, Images
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.pattern_files import drawn_by
from planning.verify.reconstruction.patterns.ring_patterns import Frame, Frames
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.view import object_window
from planning.verify.reconstruction.scanner import Scanner

from .physics import Physics
from .scene_files import pupil_points, write_object
from .scene_text import Shine, Window, scene_text, world_from_light

# Cells along a pixel of the panel, where its lens blurs the edges of its pixels.
_FOLD = 3
_CHANNELS = 3
_VARIANT = "llvm_ad_rgb"
_LIGHT = "light"


class MissingRendererError(InputError):
    """Mitsuba isn't installed, or doesn't run here."""


def mitsuba(threads: int) -> Any:  # noqa: ANN401 - Mitsuba's modules have no types
    """Return Mitsuba, ready to render on so many threads.

    Raises:
        MissingRendererError: If it can't be loaded.
    """
    try:
        module = import_module("mitsuba")
        module.set_variant(_VARIANT)
        import_module("drjit").set_thread_count(threads)
    except ImportError as error:
        raise MissingRendererError(
            f"--renderer mitsuba: Mitsuba 3 can't be loaded ({error}); install it with "
            f"`pip install 'ringrig[render]'`"
        ) from None
    module.set_log_level(module.LogLevel.Error)
    return module


class PathTracer:
    """What cameras see of a projector's frames; used as a context.

    Three frames are rendered at a time, one a channel. Light adds up, so that where a
    frame and its inverse make white on the panel, so do their images.

    Args:
        truth: What really stands there.
        physics: What light meets.
        photometry: Blur of drawn edges and of the cameras' lenses in focus, noise, room
            light; its texture is left aside.
        threads: For rendering.
    """

    def __init__(
        self, truth: Scanner, physics: Physics, photometry: Photometry, threads: int
    ) -> None:
        self._mi = mitsuba(threads)
        self._truth, self._physics, self._photometry = truth, physics, photometry
        windows = [object_window(camera, truth.mesh) for camera in truth.cameras]
        seeing = zip(truth.cameras, windows, strict=True)
        self._scanner = replace(
            truth, cameras=tuple(camera for camera, window in seeing if window)
        )
        self._windows = [Window(*window) for window in windows if window]
        self._folder = tempfile.TemporaryDirectory()
        self._place = Path(self._folder.name)
        write_object(truth, self._place, physics.surface)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._folder.cleanup()

    def frames(self, plan: Scanner, p: int, *, seed: int) -> list[tuple[str, Frames]]:
        """Return the frames of each camera that sees the object, by its id.

        Args:
            plan: For which patterns are drawn.
            p: Index of the projector in it.
            seed: Of light's paths and of the sensors' noise.
        """
        design, shown = plan.projectors[p], plan.frames(p)
        by_id = {projector.id: projector for projector in self._truth.projectors}
        if design.id not in by_id:
            return []
        drawn = drawn_by(design, plan.cameras)
        panels = {frame.name: drawn(frame) for frame in shown}
        white = panels[shown[0].name]
        # Frames that are rendered, and those that are what white leaves of another.
        asked, rest = [shown[0]], dict[str, Frame]()
        for bright, dark in zip(shown[2::2], shown[3::2], strict=True):
            asked.append(bright)
            if np.array_equal(panels[bright.name] + panels[dark.name], white):
                rest[dark.name] = bright
            else:
                asked.append(dark)
        levels: list[Images] = [
            white if frame is shown[0] else panels[frame.name] for frame in asked
        ]
        images = self._lit(by_id[design.id], levels, seed)
        names = {camera.id: c for c, camera in enumerate(plan.cameras)}
        captured: list[tuple[str, Frames]] = []
        for place, camera in enumerate(self._scanner.cameras):
            c = names.get(camera.id)
            if c is None:
                continue
            seen = dict(zip((f.name for f in asked), images[place], strict=True))
            seen[shown[1].name] = np.zeros_like(images[place][0])
            for name, bright in rest.items():
                seen[name] = seen[shown[0].name] - seen[bright.name]
            stack = np.stack([seen[name] for name in plan.frame_names(p, c)])
            captured.append((camera.id, self._captured(stack, place, (seed, p, c))))
        return captured

    def _captured(self, light: Grey, place: int, key: tuple[int, ...]) -> Frames:
        """What a sensor makes of light (n_frames, h, w), in the photometry's words."""
        photometry, window = self._photometry, self._windows[place]
        passed = self._physics.transmitted(self._scanner.cameras[place], window)
        light = (light + self._ambient[place]) * passed
        light = np.stack([photometry.blur(image) for image in light])
        gain = photometry.gain(float(np.percentile(light[0], 99.9)))
        stack = [
            photometry.capture(image, (*key, k), gain) for k, image in enumerate(light)
        ]
        return Frames(np.stack(stack), (window.left, window.top))

    @cached_property
    def _ambient(self) -> list[Grey]:
        """The room's light in each camera, (h, w)."""
        if not self._photometry.ambient > 0.0:
            return [np.zeros((w.height, w.width), np.float32) for w in self._windows]
        text = scene_text(
            self._scanner, None, self._windows, ambient=self._photometry.ambient
        )
        scene = self._loaded(text)
        return [self._image(scene, k, self._physics.spp, 0)[..., 0] for k in self._all]

    @property
    def _all(self) -> range:
        return range(len(self._windows))

    def _lit(
        self, projector: ProjectorCalibration, panels: Sequence[Images], seed: int
    ) -> list[Grey]:
        """Each camera's images (k, h, w) of panels (h, w) of 0 to 255."""
        mi, pupil = self._mi, pupil_points(self._truth)
        levels = [self._through_lens(projector, panel) for panel in panels]
        while len(levels) % _CHANNELS:
            levels.append(np.zeros_like(levels[0]))
        packs = [
            np.stack(levels[k : k + _CHANNELS], axis=-1)
            for k in range(0, len(levels), _CHANNELS)
        ]
        dark = self._place / "dark.exr"
        mi.Bitmap(np.zeros_like(packs[0])).write(str(dark))
        shine = Shine(projector, dark.name)
        scene = self._loaded(scene_text(self._scanner, shine, self._windows))
        spp = max(1, round(self._physics.spp / len(pupil)))
        sums = [
            np.zeros((len(packs), window.height, window.width, _CHANNELS), np.float32)
            for window in self._windows
        ]
        knobs = mi.traverse(scene)
        # The scene's only image is the panel's; releases call it otherwise.
        *_, image = (name for name, _ in knobs if name.endswith(".data"))
        for k, point in enumerate(pupil):
            pose = world_from_light(projector, point, self._truth.projector_focus)
            knobs[f"{_LIGHT}.to_world"] = mi.Transform4f(pose.astype(np.float32))
            for number, pack in enumerate(packs):
                knobs[image] = mi.TensorXf(pack)
                knobs.update()
                for c in self._all:
                    # The same paths for all packs: no noise between a frame and white.
                    sums[c][number] += self._image(scene, c, spp, seed * 1000 + k)
        return [
            np.moveaxis(image, -1, 1).reshape(-1, *image.shape[1:3])[: len(panels)]
            / np.float32(len(pupil))
            for image in sums
        ]

    def _through_lens(self, projector: ProjectorCalibration, panel: Images) -> Grey:
        """Light of a panel's pixels, blurred as an edge in focus is at the object."""
        level = projector.response.light.astype(np.float32)[panel.astype(np.uint8)]
        depth = float((self._truth.mesh.centre - projector.centre) @ projector.axis)
        # Pixels of the panel in a metre at the object's middle.
        dense = float(projector.matrix[0, 0])
        if projector.light.name == "diverging":
            dense /= max(depth, 1e-3)
        blur = self._photometry.projector_blur_m * dense
        if not blur > 0.0:
            return level
        cells = np.repeat(np.repeat(level, _FOLD, axis=0), _FOLD, axis=1)
        return gaussian_filter(cells, _FOLD * blur, mode="constant").astype(np.float32)

    def _loaded(self, text: str) -> Any:  # noqa: ANN401
        path = self._place / "scene.xml"
        path.write_text(text)
        values = {"material": self._physics.material}
        if self._physics.material != "skin":
            # Mitsuba refuses a parameter that nothing takes.
            values["max_depth"] = str(2 + self._physics.bounces)
        return self._mi.load_file(str(path), **values)

    def _image(self, scene: Any, place: int, spp: int, seed: int) -> Grey:  # noqa: ANN401
        return np.array(self._mi.render(scene, sensor=place, spp=spp, seed=seed))
