"""Which change of a rig the edges ask for: edges of rigs that are known to differ.

No image is rendered: points of the surface are imaged by the rig that really stands
there, and labelled with the ring coordinate at which it lights them.
"""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.reconstruction_rigs import changed
from support.simulated_edges import simulated_edges

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from planning.model.plan import RigPlan
from planning.verify.reconstruction.faults.cause_words import _two_digits, in_words
from planning.verify.reconstruction.faults.diagnosis import Diagnosis, diagnose
from planning.verify.reconstruction.faults.supposed import Evidence, Supposed
from planning.verify.reconstruction.scanner import BaselineLimit, Scanner

NOISE_PX = 0.02
EDGES = 150


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(rigs, request) -> RigPlan:
    return rigs.small_rig(rigs.bumpy_sphere(0.05, subdivisions=4), request.param)


@pytest.fixture(scope="module")
def diverging(rigs) -> RigPlan:
    return rigs.small_rig(rigs.bumpy_sphere(0.05, subdivisions=4))


def edges(plan: RigPlan, truth: RigPlan) -> Evidence:
    """Edges as a rig that really stands there gives them to who believes a plan."""
    supposed, stands = (Supposed.of(Scanner.of(one)) for one in (plan, truth))
    ids = {"cameras": [c.id for c in plan.cameras]}
    ids["projectors"] = [p.id for p in plan.projectors]
    by_id = {
        role: {device.id: device for device in getattr(stands, role)} for role in ids
    }
    order = {role: tuple(by_id[role][one] for one in ids[role]) for role in ids}
    return simulated_edges(
        supposed,
        replace(stands, **order),
        noise_px=NOISE_PX,
        outliers=0.03,
        most=EDGES,
        seed=1,
    )


def said(plan: RigPlan, truth: RigPlan) -> list[str]:
    causes = diagnose(Scanner.of(plan), edges(plan, truth)).causes
    return [in_words(cause, Scanner.of(plan)) for cause in causes]


def place(document: dict[str, Any], key: str, index: int, by: list[float]) -> None:
    """Move a device in its own axes [m]."""
    entry = document[key][index]
    pose = np.array(entry["world_from_device"])
    step = pose[:3, :3] @ np.array(by)
    for name in ("world_from_device", "world_from_ring"):
        if name in entry:
            moved = np.array(entry[name])
            moved[:3, 3] += step
            entry[name] = moved.tolist()


def stand_at(document: dict[str, Any], key: str, index: int, position) -> None:
    entry = document[key][index]
    up = np.array([0.0, 0.0, 1.0])
    entry["world_from_device"] = look_at(np.array(position), np.zeros(3), up).tolist()


def zoom(document: dict[str, Any], key: str, index: int, factor: float) -> None:
    for i in range(2):
        document[key][index]["K"][i][i] *= factor


def swap(document: dict[str, Any], key: str) -> None:
    one, two = document[key][:2]
    one["id"], two["id"] = two["id"], one["id"]


def test_edges_of_a_rig_that_stands_as_planned_ask_for_nothing(plan):
    assert diagnose(Scanner.of(plan), edges(plan, plan)) == Diagnosis()
    none = edges(plan, plan).take(np.zeros(0, int))
    assert diagnose(Scanner.of(plan), none) == Diagnosis()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda d: place(d, "cameras", 1, [2e-3, 0, 0]),
            "C2 looks as if it stood 2 mm",
        ),
        (lambda d: zoom(d, "cameras", 2, 0.99), r"C3 .* focal length were 1 % shorter"),
        (lambda d: swap(d, "cameras"), "C1 and C2 look swapped"),
        (lambda d: swap(d, "projectors"), "P1 and P2 look swapped"),
    ],
)
def test_one_change_is_named_alone(plan, change, words):
    (sentence,) = said(plan, changed(plan, change))
    assert re.search(words, sentence), sentence


@pytest.mark.long
def test_a_projectors_zoom_and_a_step_towards_the_object_are_told_or_both_named(
    diverging,
):
    (zoomed,) = said(
        diverging, changed(diverging, lambda d: zoom(d, "projectors", 0, 1.02))
    )
    assert re.match(r"P1 looks as if its focal length were 2 % longer", zoomed)
    nearer = changed(diverging, lambda d: place(d, "projectors", 0, [0, 0, 0.03]))
    (stepped,) = said(diverging, nearer)
    assert re.search(r"P1 looks as if it stood (29|30|31) mm from its place", stepped)


@pytest.mark.long
def test_a_turn_about_the_rings_axis_is_left_out_of_what_is_said(diverging):
    """It leaves no trace; the other part of the turn does."""

    def turn(document: dict[str, Any]) -> None:
        entry = document["projectors"][0]
        pose, ring = (np.array(entry[f"world_from_{k}"]) for k in ("device", "ring"))
        about = turned_about(ring[:3, 2], 5.0) @ turned_about(pose[:3, 0], 1.0)
        pose[:3, :3] = about @ pose[:3, :3]
        entry["world_from_device"] = pose.tolist()

    (sentence,) = said(diverging, changed(diverging, turn))
    found = re.search(r"P1 .* turned by at least (\S+) degrees", sentence)
    assert found, sentence
    assert float(found[1]) == pytest.approx(1.0, abs=0.06)


def turned_about(axis: np.ndarray, degrees: float) -> np.ndarray:
    x, y, z = axis
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + s * cross + (1 - c) * cross @ cross


@pytest.mark.long
def test_a_projector_far_from_its_place_is_found_and_its_light_called_grazing(
    rigs, diverging
):
    far = rigs.direction(125.0, 5.0)
    truth = changed(diverging, lambda d: stand_at(d, "projectors", 1, far))
    (sentence,) = said(diverging, truth)
    gone = 1e3 * np.linalg.norm(far - diverging.projectors[1].world_from_device[:3, 3])
    assert f"stood {gone:.0f} mm from its place" in sentence, sentence
    assert re.search(r"serve at [789]\d degrees \(median\): grazing", sentence)


def test_two_faults_are_named_one_by_one(diverging):
    def two(document: dict[str, Any]) -> None:
        place(document, "cameras", 0, [0, 2e-3, 0])
        zoom(document, "cameras", 2, 1.02)

    sentences = said(diverging, changed(diverging, two))
    assert len(sentences) == 2
    text = " | ".join(sentences)
    assert re.search("C1 looks as if it stood 2 mm", text), text
    assert re.search("C3 looks as if its focal length were 2 % longer", text), text


@pytest.mark.long
def test_the_objects_size_and_place(plan):
    mesh = plan.surface.mesh
    scale = 1.01 if plan.projectors[0].light == "diverging" else 0.98
    grown = mesh.centre + scale * (mesh.vertices - mesh.centre)
    truth = changed(plan, lambda d: None, TriangleMesh(grown, mesh.faces))
    (sentence,) = said(plan, truth)
    word = "1 % larger" if scale > 1.0 else "2 % smaller"
    assert sentence.startswith(f"the object looks {word} against the mesh"), sentence
    moved = TriangleMesh(mesh.vertices + [0.0, 0.0, 1.5e-3], mesh.faces)
    (sentence,) = said(plan, changed(plan, lambda d: None, moved))
    assert "the object looks moved by 1.5 mm" in sentence, sentence


def test_one_pair_is_enough_to_tell_a_camera_from_the_object(diverging):
    def alone(document: dict[str, Any]) -> None:
        del document["projectors"][1], document["cameras"][1:]

    one = changed(diverging, alone)
    truth = changed(one, lambda d: place(d, "cameras", 0, [3e-3, 0, 0]))
    (sentence,) = said(one, truth)
    assert sentence.startswith("C1 looks as if it stood 3 mm from its place"), sentence


def test_a_baseline_that_becomes_too_wide_is_named(diverging):
    centres = [c.world_from_device[:3, 3] for c in diverging.cameras]
    d = float(np.linalg.norm(centres[1] - centres[0]))
    limit = BaselineLimit(frozenset({"C1", "C2"}), d, d + 1e-3)
    scanner = replace(Scanner.of(diverging), baselines=(limit,))

    def apart(document: dict[str, Any], metres: float) -> None:
        away = (centres[1] - centres[0]) / d * metres
        pose = document["cameras"][1]["world_from_device"]
        for axis in range(3):
            pose[axis][3] += away[axis]

    def sentences(metres: float) -> list[str]:
        truth = changed(diverging, lambda document: apart(document, metres))
        causes = diagnose(scanner, edges(diverging, truth)).causes
        return [in_words(cause, scanner) for cause in causes]

    (sentence,) = sentences(2e-3)
    wide = f"its baseline to C1 {1e3 * d + 2:.1f} mm: too wide, eq. (10) allows"
    assert wide in sentence, sentence
    (sentence,) = sentences(-2e-3)
    assert "too wide" not in sentence


@pytest.mark.parametrize(
    ("value", "words"),
    [(178.3, "178"), (1956.0, "1956"), (14.4, "14"), (9.96, "10"), (0.0644, "0.064")],
)
def test_numbers_are_words_without_an_exponent(value, words):
    assert _two_digits(value) == words
