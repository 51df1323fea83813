"""Blur off the plane in focus: its size, where it comes from, that it is rendered."""

import numpy as np
import pytest
from support.plain_shapes import grid
from support.reconstruction_rigs import reconstruct_plan

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.patterns.defocus import Defocus, defocus_of
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import render_pair
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view

CLEAN = Photometry(noisy=False, albedo_variation=0.0)
LENS = Defocus(focus_m=1.2, aperture_m=0.012)


def figures(role, **changes):
    """The part of a plan's rig that says how a lens is focused."""
    focus = {"distance_mm": 1200.0, "f_number": 1.6, "blur_px": 5.0}
    device = {
        "K": [[1536.0, 0, 0], [0, 1536.0, 0], [0, 0, 1]],
        "figures": {"pixel_um": 12.5, "focus": focus},
    }
    optics = {"resolution": [1, 1], "range_m": [0.0, 1.0]}
    dark = optics | {"K": None}
    devices = {"projector": dark, "camera": dark} | {role: optics | device | changes}
    return {"rig": {"light": "diverging"} | devices}


def test_a_point_in_focus_is_a_disc_elsewhere():
    blur = LENS.blur_m(np.array([1.2, 1.0, 1.4]))
    assert blur == pytest.approx([0.0, 0.5e-3, 0.5e-3])


def test_focus_comes_from_the_rigs_figures(rigs):
    plan = rigs.small_rig(grid(0.1, 0.1, divisions=(2, 2)))
    assert defocus_of(plan.document.rig.projector) is None
    known = RigPlan.from_document(
        plan.to_document() | figures("projector"), plan.surface
    )
    lens = defocus_of(known.document.rig.projector)
    assert lens.focus_m == pytest.approx(1.2)
    assert lens.aperture_m == pytest.approx(0.0192 / 1.6)
    assert defocus_of(known.document.rig.camera) is None
    for changes in ({"K": None}, {"figures": {"pixel_um": 12.5}}):
        beam = RigPlan.from_document(
            plan.to_document() | figures("projector", **changes), plan.surface
        )
        assert defocus_of(beam.document.rig.projector) is None


def test_a_camera_out_of_focus_blurs_its_whole_image():
    lens = CLEAN.through_lens(Defocus(1.15, 1.09e-3), 0.9, 3478.0)
    disc = 1.09e-3 * (1.0 - 0.9 / 1.15) * 3478.0 / 0.9
    assert lens.camera_blur_px == pytest.approx(np.hypot(0.6, disc / 4))
    assert CLEAN.through_lens(None, 0.9, 3478.0) is CLEAN
    assert CLEAN.through_lens(LENS, -0.1, 3478.0) is CLEAN


@pytest.mark.parametrize("focal", [1400.0, 3478.0])
def test_edges_off_the_plane_in_focus_are_as_wide_as_the_disc_makes_them(rigs, focal):
    """On a plate square to the light all points are equally far off."""
    flat = grid(0.1, 0.1, divisions=(2, 2))
    plate = TriangleMesh(flat.vertices @ rigs.turn(0, 90.0)[:3, :3].T, flat.faces)
    plan = rigs.plan_of(
        plate,
        [rigs.diverging("P1", rigs.direction(0.0, 0.0), 0.09, 5e-3)],
        [rigs.camera("C1", rigs.direction(0.0, -30.0), focal=focal)],
    )
    camera, source = (
        calibrate_camera(plan.cameras[0]),
        calibrate_projector(plan.projectors[0]),
    )
    patterns = source.pattern_for(camera)
    caster = RayCaster(plate, threads=1)

    def frames(lens, defocus):
        seen = view(camera, plate, caster, CLEAN)
        shown = Shown(source, source, patterns, caster, defocus)
        return render_pair(seen, shown, lens, (0,)).stack

    blurred = frames(CLEAN, LENS)
    wide = Photometry(
        noisy=False,
        albedo_variation=0.0,
        projector_blur_m=float(np.hypot(0.25e-3, 0.5e-3)),
    )
    assert np.abs(blurred - frames(wide, None)).max() < 0.01
    assert np.abs(blurred - frames(CLEAN, None)).max() > 10.0


@pytest.mark.long
def test_the_check_focuses_what_really_stands_there(rigs):
    ball = rigs.bumpy_sphere(0.05, subdivisions=4)
    plan = rigs.small_rig(ball)
    near = figures("projector")["rig"] | figures("camera")["rig"]
    blurred = RigPlan.from_document(plan.to_document() | {"rig": near}, plan.surface)
    sharp, soft = (
        reconstruct_plan(one, seed=0, truth=one).merged for one in (plan, blurred)
    )
    noise = [float(np.median(m.cloud.noise_px)) for m in (sharp, soft)]
    assert noise[1] > 1.2 * noise[0]
