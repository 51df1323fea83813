"""How devices are mounted, by the audit's own arithmetic."""

import numpy as np
import pytest

from planning.report.summary.devices.device_lines import mount_lines
from planning.verify.audit.audit import audit_plan

BODY = {"centre_m": [0.0, 0.0, -0.05], "half_m": [0.03, 0.03, 0.075]}
FIGURES = {"size_mm": [60.0, 60.0, 150.0], "centre_mm": [0.0, 0.0, -50.0]}


def failures(plan):
    return audit_plan(plan, n_samples=400).failures


def with_housings(document):
    """Cubes about the cameras' axes."""
    document["rig"]["camera"].setdefault("figures", {})["body"] = FIGURES
    document["rig"]["camera"]["body"] = BODY
    for camera in document["cameras"]:
        camera["body"] = BODY


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


def gap_of(plan):
    """The distance of the two housings, from places all over both."""
    one, two = (
        camera.world_from_device[:3, 3]
        + np.stack(np.meshgrid(*[np.linspace(-1, 1, 21)] * 3), -1).reshape(-1, 3)
        * BODY["half_m"]
        @ camera.world_from_device[:3, :3].T
        - 0.05 * camera.world_from_device[:3, 2]
        for camera in plan.cameras
    )
    return min(np.linalg.norm(two - point, axis=1).min() for point in one)


@pytest.mark.long
@pytest.mark.parametrize(("more", "kept"), [(-1e-3, True), (1e-3, False)])
def test_housings_that_stand_nearer_than_the_clearance_are_named(
    plan, handmade, more, kept
):
    clearance = gap_of(plan) + more

    def change(document):
        with_housings(document)
        document["requirements"]["workspace"]["clearance_m"] = clearance
        document["rig"]["clearance_m"] = clearance

    found = failures(handmade.tampered(plan, change))
    told = [sentence for sentence in found if "from the body of C2" in sentence]
    assert (not told) == kept
    assert all(sentence.startswith("C1.body: stands ") for sentence in told)


def test_another_clearance_than_the_rigs_is_named(plan, handmade):
    def change(document):
        document["rig"]["clearance_m"] = 0.013

    found = failures(handmade.tampered(plan, change))
    assert any(
        "workspace.clearance_m: claimed 0 m, recomputed 0.013 m" in f for f in found
    )


MOUNT = {"offset_mm": [0.0, 30.0, -40.0], "axis": [0.0, 2.0, 0.0]}


def with_mounts(document):
    """Threads 30 mm below and 40 mm behind the optical centres of cameras."""
    document["rig"]["camera"].setdefault("figures", {})["mount"] = MOUNT
    document["requirements"]["workspace"]["camera_mount"] = {
        "offset_m": [0.0, 0.03, -0.04],
        "axis": [0.0, 1.0, 0.0],
    }
    for camera in document["cameras"]:
        pose = np.array(camera["world_from_device"])
        x, y, z = pose[:3, :3].T
        mount = np.eye(4)
        # Out of the device is down, forward is forward.
        mount[:3, :3] = np.column_stack([z, x, y])
        mount[:3, 3] = pose[:3, 3] + 0.03 * y - 0.04 * z
        camera["world_from_mount"] = mount.tolist()


def test_mounts_stand_where_devices_put_them(plan, handmade):
    mounted = handmade.tampered(plan, with_mounts)
    assert audit_plan(mounted, n_samples=20_000).failures == ()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda d: d["cameras"][1]["world_from_mount"][0].__setitem__(3, 0.5),
            "C2.world_from_mount: claimed",
        ),
        (
            lambda d: d["cameras"][0].pop("world_from_mount"),
            "C1.world_from_mount: claimed None",
        ),
        (
            lambda d: d["requirements"]["workspace"]["camera_mount"].update(
                offset_m=[0.0, 0.03, 0.04]
            ),
            "camera_mount.offset_m: claimed",
        ),
        (
            lambda d: d["requirements"]["workspace"].pop("camera_mount"),
            "camera_mount: None is claimed, but the rig file has",
        ),
    ],
)
def test_a_mount_elsewhere_is_named(plan, handmade, change, sentence):
    def both(document):
        with_mounts(document)
        change(document)

    found = failures(handmade.tampered(plan, both))
    assert any(sentence in failure for failure in found), found


def test_the_summary_says_where_mounts_are(plan, handmade):
    mounted = handmade.tampered(plan, with_mounts)
    assert mount_lines(plan) == []
    _, head, first, second = mount_lines(mounted)
    assert "mount x, y, z [mm]" in head
    assert (first[:2], second[:2]) == ("C1", "C2")
    numbers = [
        float(word)
        for word in first[2:].replace("(", "").replace(")", "").replace(",", "").split()
    ]
    turn = mounted.cameras[0].world_from_device[:3, :3]
    position = 1e3 * (mounted.cameras[0].world_from_device @ [0, 0.03, -0.04, 1])[:3]
    assert numbers[:3] == pytest.approx(position, abs=0.05)
    assert numbers[3:6] == pytest.approx(turn[:, 1], abs=1e-4)
    assert numbers[6:] == pytest.approx(turn[:, 2], abs=1e-4)
