"""How far drawn edges lie off their rings on a plane, in pixels of the projector.

A plane square to a projector of 0.56 mm pixels, seen at 20 degrees by a camera of twice
as many; no noise, no texture. Light is blurred as the table says, in focus or out of
it; the image by 0.2 px of the camera and its pixels, so that what is off is the panel's
doing. `steps` shows pixels that are bright or dark and nothing between.

    python -m benchmarks.pixels.panel_edges
"""

from dataclasses import replace

import numpy as np
from support import reconstruction_rigs as rigs
from verify.reconstruction.test_reconstruction_decode import edge_error_px, plate

from geometry.rays.rays import RayCaster
from planning.model.devices.planned import edge_linearity_px
from planning.verify.reconstruction.calibration import (
    PairCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.decode.edges import find_edges
from planning.verify.reconstruction.patterns.response import Response
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import render_pair
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view

BLURS_PX = (0.15, 0.25, 0.35, 0.45, 0.6, 0.9, 1.3)
STEPS = Response(tuple([0.0] * 128 + [1.0] * 128))
GAMMA = Response(2.2)
_CAMERA_BLUR_PX = 0.2


def errors_px(blur_px: float, response: Response) -> tuple[np.ndarray, float]:
    """Return how far edges are off [px of the projector], and how far points [m]."""
    mesh = plate(rigs, 0.12, 0.10)
    plan = rigs.plan_of(
        mesh,
        [rigs.diverging("P1", rigs.direction(0.0, 0.0), 0.09, 6e-3)],
        [rigs.camera("C1", rigs.direction(0.0, -20.0), focal=3600.0)],
    )
    camera = calibrate_camera(plan.cameras[0])
    source = replace(calibrate_projector(plan.projectors[0]), response=response)
    patterns, caster = source.pattern_for(camera), RayCaster(mesh, threads=1)
    pixel_m = float(source.pixel_m(np.zeros((1, 3)))[0])
    light = Photometry(
        noisy=False,
        albedo_variation=0.0,
        camera_blur_px=_CAMERA_BLUR_PX,
        projector_blur_m=blur_px * pixel_m,
    )
    seen = view(camera, mesh, caster, light)
    assert seen is not None
    frames = render_pair(seen, Shown(source, source, patterns, caster), light, (0,))
    edges, *_ = find_edges(frames, patterns)
    pair = PairCalibration(source, camera)
    seen_px = pixel_m * camera.focal_px
    return edge_error_px(edges, patterns, pair) / seen_px, pixel_m


def main() -> None:
    """Print the table."""
    print("| drawn | blur [px] | all blur | edges | rms [px] | law | 95 % | mean |")
    print("|---|---|---|---|---|---|---|---|")
    for name, response in (
        ("covered area", Response()),
        ("covered area, gamma 2.2", GAMMA),
        ("steps", STEPS),
    ):
        for blur_px in BLURS_PX:
            off, pixel_m = errors_px(blur_px, response)
            own = np.hypot(_CAMERA_BLUR_PX, np.sqrt(1.0 / 12.0)) / (3600.0 * pixel_m)
            every = float(np.hypot(blur_px, own))
            law = f"{float(edge_linearity_px(np.array(every))):.4f}"
            print(
                f"| {name} | {blur_px:g} | {every:.2f} | {len(off)} | "
                f"{np.sqrt(np.mean(off**2)):.4f} | "
                f"{law if response is not STEPS else ''} | "
                f"{np.quantile(np.abs(off), 0.95):.4f} | {off.mean():+.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
