"""Lists of several models in rig files: read, refused, laid over, and shown."""

import numpy as np
import pytest

from planning import load_rig
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.requirements import Stock
from planning.rig.wishes import Wishes

NARROW = {
    "name": "narrow",
    "resolution_px": [2048, 1536],
    "focal_mm": 30.0,
    "pixel_um": 3.45,
    "range_mm": [800.0, 1400.0],
    "count": 2,
}
WIDE = NARROW | {"name": "wide", "focal_mm": 8.0, "count": 1}
PHOTOMETRY = {"lumens": 3000, "albedo": 0.5, "sensor": "imx250"}


def mixed(*cameras: object, **tables: object):
    return load_rig({"base": "default", "camera": [*cameras], **tables})


def required(rig, **asked):
    wishes = Wishes(**{"max_projectors": 3} | asked)
    return rig.requirements(np.zeros(3), 0.1, wishes, tau_m=1.0)


def test_each_of_a_list_is_a_model_of_its_own():
    rig = mixed(NARROW, WIDE)
    assert [model.name for model in rig.models("camera")] == ["narrow", "wide"]
    focal = [device.focal_px for device in rig.optics[1]]
    assert focal == pytest.approx([30.0 / 3.45e-3, 8.0 / 3.45e-3])
    # The kind that has one model has no name to tell.
    assert [model.name for model in rig.models("projector")] == [""]
    assert required(rig).stock == (
        Stock("camera", "narrow", 2),
        Stock("camera", "wide", 1),
    )
    document = rig.to_document()
    assert document["camera"]["count"] == 2
    assert [other["name"] for other in document["more_cameras"]] == ["wide"]
    assert required(rig).to_document()["stock"][0]["count"] == 2
    assert "stock" not in required(load_rig()).to_document()


def test_devices_of_the_catalogue_stand_in_lists_too():
    rig = mixed("basler/acA2040-55um + 16mm", NARROW)
    first, second = rig.models("camera")
    assert first.table.device == "basler/acA2040-55um + 16mm"
    assert second.name == "narrow"


def test_the_first_may_be_laid_over_the_base():
    rig = mixed({"count": 3}, WIDE)
    assert rig.models("camera")[0].table.name == load_rig().table.camera.name
    assert rig.models("camera")[0].table.count == 3


def test_of_one_model_the_count_is_the_most_that_may_be_taken():
    rig = load_rig({"base": "default", "camera": NARROW})
    assert rig.models("camera")[0].name == ""
    assert required(rig).max_cameras == 2
    assert required(rig, max_cameras=1).max_cameras == 1
    assert required(rig).stock == ()
    lit = load_rig({"base": "default", "projector": {"count": 2}})
    assert required(lit).max_projectors == 2
    alone = required(lit, pattern="none", max_projectors=0, views=2)
    assert alone.max_projectors == 0


def test_existing_devices_say_which_model_they_are():
    standing = {"kind": "camera", "position_mm": [0, -900, 0], "aim_mm": [0, 0, 0]}
    rows = [
        standing | {"name": "a", "model": "wide"},
        standing | {"name": "b", "position_mm": [900, 0, 0]},
    ]
    one, other = required(mixed(NARROW, WIDE, existing=rows)).existing
    assert (one.model, other.model) == ("wide", "narrow")
    with pytest.raises(RigError, match=r"'tele' is none of the rig's cameras"):
        required(mixed(NARROW, WIDE, existing=[rows[0] | {"model": "tele"}]))
    rows[1] |= {"model": "wide"}
    with pytest.raises(InfeasibleLimitsError, match=r"2 existing .* count = 1"):
        required(mixed(NARROW, WIDE, existing=rows))


MOUNT = {"offset_mm": [0, 30, 0], "axis": [0, 1, 0]}
FOCUS = {"distance_mm": 1000, "f_number": 2.8, "blur_px": 2}
REFUSED = {
    "no device": ([], "empty list; write a device"),
    "two of one name": ([NARROW, NARROW], "'narrow' more than once"),
    "two mounts": ([NARROW | {"mount": MOUNT}, WIDE], "different mounts"),
    "no such device": ([NARROW, "basler/none + 8mm"], r"camera\[1\]\] device"),
    "no name": ([NARROW, {"count": 2}], r"camera\[1\].*missing"),
    "a count of none": ([NARROW, WIDE | {"count": 0}], r"camera\[1\].count` = 0"),
    "a key of none": (
        [NARROW, WIDE | {"cuont": 2}],
        r"camera\[1\].*mean count",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_list_that_is_none_is_refused(name):
    cameras, words = REFUSED[name]
    with pytest.raises(RigError, match=words):
        mixed(*cameras).models("camera")


def test_light_is_of_one_model():
    focused = NARROW | {"focus": FOCUS}
    with pytest.raises(RigError, match=r"\[photometry\] is of one projector and one"):
        mixed(focused, WIDE, photometry=PHOTOMETRY)


def test_projectors_of_a_list_are_focused_alike():
    first = {"count": 1}
    other = {
        "name": "short throw",
        "resolution_px": [1920, 1080],
        "throw_ratio": 0.8,
        "pixel_um": 8.0,
        "focus": FOCUS,
    }
    with pytest.raises(
        RigError, match=r"\[\[projector\]\] 2 is focused at 1000 mm through a pupil of"
    ):
        load_rig({"base": "default", "projector": [first, other]})


@pytest.mark.parametrize(
    ("wider", "farther", "told"),
    [
        (1.0, 1.0, ""),
        (1.004, 0.996, ""),
        (0.994, 1.0, "through a pupil of 9.161 mm.*first .* of 9.216"),
        (1.0, 1.006, "1006 mm through .* first is focused at 1000 mm"),
    ],
)
def test_pupils_that_rounded_numbers_give_are_alike(wider, farther, told):
    """No f-number of a few digits gives two lenses the same to the last digit."""
    first = {"name": "a", "resolution_px": [1920, 1080], "throw_ratio": 1.5}
    first |= {"pixel_um": 8.0, "focus": {"distance_mm": 1000.0, "f_number": 2.5}}
    first["focus"]["blur_px"] = 5.0
    other = first | {"name": "b", "throw_ratio": 0.8}
    number = 2.5 * 0.8 / 1.5 / wider
    focus = {"distance_mm": 1000.0 * farther, "f_number": number, "blur_px": 5.0}
    rig = {"base": "default", "projector": [first, other | {"focus": focus}]}
    if not told:
        assert len(load_rig(rig).models("projector")) == 2
        return
    with pytest.raises(RigError, match=told) as refused:
        load_rig(rig)
    pupils = [part.split()[0] for part in str(refused.value).split("a pupil of ")[1:]]
    assert len(set(pupils)) == (1 if wider == 1.0 else 2)


def test_a_model_that_isnt_sharp_is_named():
    far = WIDE | {"range_mm": [2000.0, 3000.0]}
    with pytest.raises(InfeasibleLimitsError, match="which camera 2 is sharp"):
        mixed(NARROW, far)


def test_a_whole_device_takes_the_place_of_a_list():
    rig = mixed(NARROW, WIDE)
    assert [m.name for m in rig.replace(camera=(WIDE, NARROW)).models("camera")] == [
        "wide",
        "narrow",
    ]
    for one in (NARROW, "basler/acA2040-55um + 16mm"):
        assert len(rig.replace(camera=one).models("camera")) == 1
    # Some figures of the first leave the others where they are.
    longer = rig.replace(camera={"focal_mm": 35.0})
    assert len(longer.models("camera")) == 2
