"""The other side's own code re-projects what the plan does; skipped where it's absent.

`pip install 'ringrig[exports-check,render]'` has the readers.
"""

import numpy as np
import pytest
from support import camera_readers as readers
from support import double_readers as doubles
from support import solid_readers as solids
from support.exported_plans import exported_plan, points_before

from planning.handover.export.export_formats import FORMATS
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.mitsuba_export import write_mitsuba
from planning.handover.export.write_exports import write_export
from planning.verify.reconstruction.render.mitsuba.materials import Surface

FORM = {form.name: form for form in FORMATS}


@pytest.fixture(scope="module")
def rig():
    plan = exported_plan()
    turned = frame_of("5,-50,30,40,20,-10", plan.requirements.workspace)
    return ExportedRig.of(plan, turned)


@pytest.mark.parametrize(
    ("name", "reader", "packages"),
    [
        ("opencv", readers.opencv, ["cv2"]),
        ("colmap", readers.colmap_text, ["pycolmap"]),
        ("colmap", readers.colmap_binary, ["pycolmap"]),
        ("gltf", readers.gltf_extras, ["pygltflib", "cv2"]),
        ("ros", readers.ros, ["yourdfpy", "cv2"]),
        ("ros", readers.ros_transforms, ["yaml", "cv2"]),
        ("usd", readers.usd_attributes, ["pxr", "cv2"]),
        ("usd", readers.usd_frustum, ["pxr"]),
        ("csv", readers.tables, ["cv2"]),
    ],
)
def test_points_re_project_within_a_millionth_of_a_pixel(
    name, reader, packages, rig, tmp_path
):
    for package in packages:
        pytest.importorskip(package, reason=f"{package} isn't installed: exports-check")
    write_export(rig, FORM[name], tmp_path)
    points = {device.id: points_before(device) for device in rig.devices}
    found = reader(tmp_path, points)
    assert found.keys() >= {"P1", "C1", "C2", "C3"}
    if reader is readers.usd_frustum:
        # What USD's own cameras lack is distortion, and it says so.
        del found["C1"]
    for device in rig.devices:
        if device.id in found:
            want = device.project(points[device.id])
            np.testing.assert_allclose(found[device.id], want, atol=1e-6)


@pytest.mark.parametrize(
    ("reader", "off_px"), [(doubles.mitsuba_in_double, 1e-6), (readers.mitsuba, 1e-3)]
)
def test_mitsuba_s_scenes_re_project_as_far_as_its_precision_goes(
    reader, off_px, rig, tmp_path
):
    pytest.importorskip("mitsuba", reason="mitsuba isn't installed: render")
    write_mitsuba(rig, tmp_path, Surface(), None)
    points = {device.id: points_before(device) for device in rig.devices}
    found = reader(tmp_path, points)
    # C1's distortion is left out, and P2's parallel light comes from 100 km away.
    for name, off in {"P1": off_px, "C2": off_px, "C3": off_px, "P2": 3e-3}.items():
        device = next(each for each in rig.devices if each.id == name)
        want = device.project(points[name])
        np.testing.assert_allclose(found[name], want, atol=off)


@pytest.mark.parametrize(
    ("name", "reader", "package"),
    [
        ("step", solids.step_gmsh, "gmsh"),
        ("step", solids.step_opencascade, "OCP"),
        ("drawing", solids.dxf, "ezdxf"),
    ],
)
def test_housings_and_points_are_where_the_plan_has_them(
    name, reader, package, rig, tmp_path
):
    pytest.importorskip(package, reason=f"{package} isn't installed: exports-check")
    write_export(rig, FORM[name], tmp_path)
    assert reader(tmp_path, rig)[0] < 1e-6
