"""Figures after the paper's 5 to 10, drawn from what an experiment gave."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planning.verify.reconstruction.captures.captures import whole_image
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import render_lines
from planning.verify.reconstruction.render.rendered import RenderedScene
from planning.verify.reconstruction.single_shot.single_shot import drawn_lines

from .ground_truth import MeasuredErrors
from .paper_devices import CAMERA_PX
from .point_panels import (
    KEPT,
    PROJECTORS,
    REMOVED,
    RINGS,
    Legend,
    PanelStage,
    captioned,
    chosen_colours,
    colour_bar,
    side_by_side,
    signed_colours,
)
from .run import Outcome
from .setups import Experiment

_SMOOTH = Image.Resampling.LANCZOS
# In the dark nothing shows but the rings; the eye wants to see the object too.
_ROOM_LIGHT = 0.1
_ERROR_MM = 0.1
_MM = 1e3


def camera_images(
    experiment: Experiment, photometry: Photometry
) -> tuple[NDArray[np.uint8], ...]:
    """Return what each camera sees under bright rings of all projectors, (h, w) each.

    Where rings of both projectors cross, their light adds up: the paper's Fig. 3.
    """
    scanner = experiment.scanner
    scene = RenderedScene(scanner, scanner, photometry)
    images: list[NDArray[np.uint8]] = []
    for c, camera in enumerate(scanner.cameras):
        grey, seen = np.zeros(CAMERA_PX[::-1]), scene.seen(c)
        if seen is not None:
            lines = [
                drawn_lines(one, one.pattern_for(camera), scanner.mesh)[1]
                for one in scanner.projectors
            ]
            shown = [scene.shown(p, drawn) for p, drawn in enumerate(lines)]
            every = [one for one in shown if one is not None]
            frames = render_lines(seen, every, photometry, (0, 9, c))
            (grey,) = whole_image(frames, CAMERA_PX)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return tuple(images)


def draw_camera_images(outcome: Outcome) -> Image.Image:
    """Return what the cameras see, side by side: the paper's Figs. 5 and 6."""
    experiment = outcome.experiment
    ambient = max(outcome.photometry.ambient, _ROOM_LIGHT)
    images = camera_images(experiment, replace(outcome.photometry, ambient=ambient))
    names = [camera.id for camera in experiment.scanner.cameras]
    added = ambient > outcome.photometry.ambient
    seen_by = f"; {ambient:.0%} room light added for the eye" if added else ""
    field = " x ".join(f"{_MM * side:.0f}" for side in experiment.optics.field_m)
    panels = [
        captioned(
            Image.fromarray(image).convert("RGB").resize((640, 360), _SMOOTH),
            f"{name}: rings of both projectors; {field} mm at 1 m{seen_by}",
        )
        for name, image in zip(names, images, strict=True)
    ]
    return side_by_side(panels, columns=2)


def draw_viewpoints(outcome: Outcome, stage: PanelStage) -> Image.Image:
    """Return the points of each viewpoint, coloured by ring: the paper's Fig. 7."""
    clouds = outcome.clouds[:-2]
    legend = [
        (f"{_MM * radius:.4g} mm", RINGS[k % len(RINGS)])
        for k, radius in enumerate(outcome.experiment.radii_m)
    ]
    panels = [_ring_panel(stage, one.name, one.cloud, legend) for one in clouds]
    return side_by_side(panels, columns=3)


def draw_redundancy(outcome: Outcome, stage: PanelStage) -> Image.Image:
    """Return what is removed and what stays, merged: the paper's Figs. 8 and 9."""
    everything, merged = outcome.union.cloud, outcome.merged.cloud
    stays = outcome.reconstruction.merged.stays
    colours = np.where(stays[:, None], np.array(KEPT), np.array(REMOVED))
    ids = [projector.id for projector in outcome.experiment.scanner.projectors]
    panels = [
        stage.panel(
            f"Removed, redundant or at steps: {int(np.sum(~stays))} of {len(stays)}",
            everything.points,
            colours.astype(np.float64),
            [("stays", KEPT), ("removed", REMOVED)],
        ),
        stage.panel(
            f"Merged: {len(merged)} points",
            merged.points,
            chosen_colours(PROJECTORS, merged.projector),
            list(zip(ids, PROJECTORS, strict=True)),
        ),
    ]
    return side_by_side(panels, columns=2)


def draw_errors(outcome: Outcome, stage: PanelStage) -> Image.Image:
    """Return signed errors of one viewpoint and of the merged cloud, and a scale."""
    panels: list[Image.Image] = []
    for one in (outcome.clouds[0], outcome.merged):
        p95 = one.errors.p95_m
        far = "no point" if p95 is None else f"95 % within {_MM * p95:.3f} mm"
        colours = signed_colours(_MM * one.distances, _ERROR_MM)
        panels.append(stage.panel(f"{one.name}: {far}", one.cloud.points, colours))
    bar = colour_bar(2 * stage.width, _ERROR_MM)
    return side_by_side(panels, columns=2, foot=bar)


def draw_densities(
    first: MeasuredErrors, both: MeasuredErrors, stage: PanelStage
) -> Image.Image:
    """Return the points of one sequence beside those of two."""
    titled = (("One sequence", first), ("Two, the second shifted", both))
    panels = [_ring_panel(stage, title, one.cloud) for title, one in titled]
    return side_by_side(panels, columns=2)


def _ring_panel(
    stage: PanelStage, title: str, cloud: Cloud, legend: Legend = ()
) -> Image.Image:
    """Return a panel of points, coloured by ring."""
    colours = chosen_colours(RINGS, cloud.ring)
    return stage.panel(f"{title}: {len(cloud)} points", cloud.points, colours, legend)
