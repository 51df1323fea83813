"""How devices are mounted, by the audit's own arithmetic."""

import numpy as np
import pytest

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
