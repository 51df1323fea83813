"""Eq. (8): its terms, what follows from a plan, and what a person reads."""

import numpy as np
import pytest

from geometry.devices import PinholeModel
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.device_records import (
    ProjectorRecord,
    camera_record,
    projector_record,
)
from planning.model.document.input_records import RigRecord
from planning.model.document.ring_records import CreasesRecord, RingsRecord
from planning.report.entries.cost_entry import cost_record
from planning.report.summary.check_lines import cost_lines
from planning.rings.acquisition import frame_time, n_frames, pixels_read
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

MODEL = PinholeModel(np.diag([3000.0, 3000.0, 1.0]), (2000, 1500), (0.5, 2.0))
CAMERAS = tuple(PlannedCamera(name, np.eye(4), MODEL) for name in ("C1", "C2"))
PLANNING = {
    "regions": 0.25,
    "projectors": 1.0,
    "bounds": 0.25,
    "projector_poses": 0.25,
    "rings": 0.25,
    "cameras": 2.0,
    "baselines": 1.0,
    "camera_bounds": 0.5,
    "claims": 0.25,
    "relaxations": 0.25,
}
SCAN = {"render": 60.0, "decode": 3.0, "merge": 0.5}


def projector(n_rings: int) -> PlannedProjector:
    radii = np.linspace(0.01, 0.1, n_rings)
    return PlannedProjector("P", "diverging", np.eye(4), np.eye(4), MODEL, radii)


def lights(one: PlannedProjector, left_out=()) -> ProjectorRecord:
    rings = RingsRecord(
        spacing="uniform",
        kept_even=False,
        n_even=9,
        gap_m=None,
        over_tolerance=0.0,
        creases=CreasesRecord(length_m=0.0, max_error_m=0.0),
        left_out=left_out,
    )
    record = projector_record(one, min_margin_rad=None, lit_area_m2=0.0)
    return record.changed(rings=rings if left_out else None)


def rig(camera_hz=55.0, projector_hz=60.0, exposure_ms=None) -> RigRecord:
    model = {"K": None, "resolution": (2, 2), "range_m": (0.0, 1.0)}
    camera = {"frame_rate_hz": camera_hz, "exposure_ms": exposure_ms}
    return RigRecord(
        light="diverging",
        projector=model | {"figures": {"frame_rate_hz": projector_hz}},
        camera=model | {"figures": camera},
    )


def cost(n_before=3, scan=SCAN, stages=None, **rates):
    return cost_record(
        rig(**rates),
        [lights(projector(3)), lights(projector(4), left_out=(0.2, 0.3, 0.4, 0.5))],
        [camera_record(c, seen_area_m2=0.0, sole_area_m2=0.0) for c in CAMERAS],
        n_before=n_before,
        stages=(PLANNING if stages is None else stages) | {"check": 90.0},
        scan=scan,
    )


@pytest.mark.parametrize("n_rings", [2, 3, 4, 7, 8, 31, 32, 77])
@pytest.mark.parametrize("n_cameras", [1, 5])
def test_frames_are_those_that_the_patterns_have(n_rings, n_cameras):
    one = projector(n_rings)
    drawn = DrawnRings(LIGHTS["diverging"], one.ring_radii)
    ids = [f"C{c}" for c in range(n_cameras)]
    assert n_frames([one] * 2, n_cameras) == 2 * len(drawn.frames(ids))


@pytest.mark.parametrize(
    ("rates", "seconds"),
    [
        ((30.0, 60.0, None), 2 / 60),
        ((60.0, 60.0, None), 1 / 60),
        ((200.0, 60.0, 0.010), 1 / 60),
        ((55.0, 60.0, 0.0166), 2 / 60),
        ((55.0, 60.0, 0.040), 3 / 60),
        ((49.0, 49.0, 1 / 49), 1 / 49),
        ((None, 60.0, 0.01), None),
        ((55.0, None, 0.01), None),
    ],
)
def test_a_frame_takes_whole_refreshes_of_the_projector(rates, seconds):
    assert frame_time(*rates) == (seconds and pytest.approx(seconds))


def test_eq_8_before_and_after_the_number_of_cameras_was_minimised():
    """C = (sum M N)(t1 + t2) + t3 + t4 + t5; rendering and the check are no part."""
    entry = cost()
    assert entry.pixels == 2 * 2000 * 1500
    # 4 annuli, 2 bits; 5 annuli, 3 bits; each with 2 discs, white and black.
    assert entry.n_frames == (2 + 4 + 4) + (2 + 6 + 4)
    assert entry.frame_s == pytest.approx(1 / 30)
    assert entry.t1 * entry.pixels == pytest.approx(22 / 30)
    assert (entry.t2 * entry.pixels, entry.t3) == pytest.approx((3.0, 0.5))
    assert entry.C == pytest.approx(22 / 30 + 3.0 + 0.5 + 2.0 + 4.0)
    # A third camera: its pixels, and its disc and inverse under both projectors.
    assert entry.C_before == pytest.approx(26 / 30 + 4.5 + 0.5 + 2.0 + 4.0)
    # 4 rings more are 9 annuli, 4 bits.
    assert entry.C_all_rings == pytest.approx(24 / 30 + 3.0 + 0.5 + 2.0 + 4.0)
    assert entry.render_s == 60.0
    assert pixels_read([projector(3), projector(4)], CAMERAS) == 22 * entry.pixels


def test_every_stage_of_planning_is_in_t4_or_t5():
    """Also one that this test doesn't know: only the check is neither."""
    entry = cost()
    assert (entry.t4, entry.t5) == (2.0, 4.0)
    stages = PLANNING | {"a new stage": 8.0}
    entry = cost(stages=stages)
    assert entry.t4 + entry.t5 == sum(stages.values())


def told(entry, handmade, *left_out) -> list[str]:
    document = handmade.build_plan().document
    projectors = [lights(p.planned(), left_out) for p in document.projectors[:1]]
    return cost_lines(document.changed(cost=entry, projectors=tuple(projectors)))


def test_a_person_reads_the_scan_its_terms_and_what_minimising_won(handmade):
    scan, total, before, rings = told(cost(), handmade, 0.3, 0.4)
    assert "22 frames of 33.3 ms, 0.73 s; 6.0 Mpx to points 3.00 s" in scan
    assert "planning of 2.0 + 4.0 s: C = 10.2 s" in total
    assert before.strip() == (
        "11.9 s with the 3 cameras of a greedy cover: minimising D saved 1.63 s"
    )
    assert rings.strip() == (
        "10.3 s with the 2 rings that would miss the object: leaving them out saved "
        "0.07 s"
    )
    last = told(cost(n_before=2), handmade)[-1]
    assert last.endswith("minimising D saved nothing")


def test_what_is_not_known_is_not_claimed(handmade):
    unchecked = cost(scan=None)
    assert (unchecked.C, unchecked.t2, unchecked.render_s) == (None, None, None)
    (line,) = told(unchecked, handmade)
    assert line == "COST     a scan is 22 frames of 33.3 ms, 0.73 s"
    no_rate = cost(camera_hz=None)
    assert (no_rate.t1, no_rate.C, no_rate.C_before) == (None, None, None)
    assert no_rate.t2 is not None
    (line,) = told(no_rate, handmade)
    assert "a scan is 22 frames; frame_rate_hz of camera or projector isn't" in line
