"""Optics of a rig against its figures: every rig that comes along, and closed forms."""

import pytest

from planning import load_rig
from planning.model.document.input_records import ModelRecord, RigRecord
from planning.rig.toml.preset_files import preset_names
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.optics_claims import audit_model

CALIBRATED = {
    "name": "calibrated",
    "K": [[1500.0, 0.0, 640.5], [0.0, 1510.0, 470.25], [0.0, 0.0, 1.0]],
    "resolution": [1280, 960],
    "distortion": [-0.1, 0.02, 1e-4, -2e-4, 0.0],
    "range_m": [0.4, 2.0],
    "figures": {
        "resolution_px": [1280, 960],
        "focal_px": [1500.0, 1510.0],
        "principal_point_px": [640.5, 470.25],
        "distortion": [-0.1, 0.02, 1e-4, -2e-4, 0.0],
        "range_mm": [400.0, 2000.0],
    },
}


def failures(model, kind):
    findings = AuditFindings()
    audit_model(model, kind, findings)
    return findings.failures


@pytest.mark.parametrize("name", preset_names())
def test_optics_of_rigs_that_come_along_follow_from_their_figures(name):
    rig = RigRecord(**load_rig(name).to_document())
    for kind in ("projector", "camera"):
        for model in rig.models(kind):
            assert failures(model, kind) == ()


def test_what_a_calibration_states_is_taken_as_it_stands():
    assert failures(ModelRecord(**CALIBRATED), "camera") == ()
    # A projector's lens is taken as straight.
    (failure,) = failures(ModelRecord(**CALIBRATED), "projector")
    assert failure.startswith("distortion: claimed")
    (failure,) = failures(ModelRecord(**CALIBRATED | {"range_m": [0.4, 2.1]}), "camera")
    assert failure.startswith("range_m: claimed")


def test_a_coefficient_less_is_another_lens():
    figures = CALIBRATED["figures"] | {"distortion": [-0.1, 0.02, 1e-4, -2e-4]}
    (failure,) = failures(ModelRecord(**CALIBRATED | {"figures": figures}), "camera")
    assert failure.startswith("distortion: claimed")


def test_depth_of_field_is_that_of_similar_triangles():
    # f = 10 mm at f/2 on 10 um pixels, set to 1 m: the sensor is 10.10101 mm behind.
    figures = CALIBRATED["figures"] | {
        "focal_px": [1000.0, 1000.0],
        "pixel_um": 10.0,
        "range_mm": [1.0, 1e6],
        "focus": {"distance_mm": 1000.0, "f_number": 2.0, "blur_px": 1.0},
    }
    aperture, behind, blur = 5e-3, 1.0 / (100.0 - 1.0), 1e-5
    ends = []
    for sign in (1.0, -1.0):
        # The cone |behind - image| aperture / image is as wide as a pixel.
        image = behind / (1.0 + sign * blur / aperture)
        ends.append(1.0 / (100.0 - 1.0 / image))
    model = CALIBRATED | {"figures": figures, "range_m": sorted(ends)}
    model |= {"K": [[1000.0, 0.0, 640.5], [0.0, 1000.0, 470.25], [0.0, 0.0, 1.0]]}
    assert failures(ModelRecord(**model), "camera") == ()
    figures["focus"] = figures["focus"] | {"distance_mm": 9.0}
    assert failures(ModelRecord(**model), "camera")
