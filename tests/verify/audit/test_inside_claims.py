"""What a plan says about the inside of a body: claimed, told, and audited."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.plain_shapes import flipped, joined, turned

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.repair.hollow import MeshShell, lies_inside, measure_shell
from geometry.shapes.primitives import sphere
from planning.model.document.coverage_records import Coverage
from planning.model.document.input_records import MeshRecord
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.report.entries.device_entries import mesh_record
from planning.report.summary.shortfall import shortfalls
from planning.report.summary.summary import shell_line
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import draw_samples
from planning.verify.audit.coverage.inside_claims import audit_inside
from planning.verify.audit.predicates.occlusion import Shadow

OUTER, INNER = sphere(0.1, subdivisions=3), sphere(0.096, subdivisions=3)
HOLLOW = joined(OUTER, flipped(INNER))


def surface(mesh: TriangleMesh) -> Surface:
    n = len(mesh.faces)
    none = np.zeros((0, 4, 4))
    # The target is the half of both walls above the middle.
    region = np.where(mesh.face_centroids[:, 2] > 0, 0, -1)
    zero = np.zeros(n, dtype=np.int64)
    return Surface(mesh, zero, region, np.zeros((n, 3)), none, none, none)


def found(
    mesh: TriangleMesh,
    document: dict[str, Any],
    target: str = "dominant",
    region: np.ndarray | None = None,
) -> tuple[str, ...]:
    stated = surface(mesh)
    stated = stated if region is None else replace(stated, region=region)
    samples = draw_samples(stated, target, 20_000, 0)
    # Projectors reach the outer wall alone.
    reached = np.linalg.norm(samples.points, axis=1) > 0.0975
    areas = {
        "area_m2": mesh.area,
        "target_m2": samples.weights[samples.in_target].sum(),
    }
    meshes = [MeshRecord.model_validate(entry) for entry in document["meshes"]]
    coverage = Coverage.model_construct(**document["coverage"])
    case: Any = SimpleNamespace(
        plan=SimpleNamespace(
            coverage=coverage,
            surface=stated,
            document=SimpleNamespace(meshes=meshes),
            requirements=SimpleNamespace(target=target),
        ),
        samples=samples,
        reachable=SimpleNamespace(projectors=reached),
        estimator=SimpleNamespace(**areas),
        shadow=Shadow(mesh, threads=2),
        seed=0,
    )
    findings = AuditFindings()
    audit_inside(case, findings)
    return findings.failures


@cache
def shell_of(mesh: TriangleMesh) -> MeshShell:
    return measure_shell(RayCaster(mesh))


def claims(mesh: TriangleMesh, inside_m2: float, dark_m2: float) -> dict[str, Any]:
    entry = mesh_record(mesh, shell_of(mesh)).to_document()
    entry["shell"]["inside_m2"] = inside_m2
    return {"meshes": [entry], "coverage": {"unreachable_inside_m2": dark_m2}}


def silent(mesh: TriangleMesh) -> dict[str, Any]:
    """Of a plan that says nothing of what lies inside."""
    document = claims(mesh, 0.0, 0.0)
    del document["meshes"][0]["shell"], document["coverage"]["unreachable_inside_m2"]
    return document


def dark_area() -> float:
    return float(INNER.face_areas[INNER.face_centroids[:, 2] > 0].sum())


def test_the_audit_finds_the_inside_of_a_hollow_ball_by_itself() -> None:
    assert found(HOLLOW, claims(HOLLOW, INNER.area, dark_area())) == ()
    assert found(OUTER, claims(OUTER, 0.0, 0.0)) == ()


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_a_fifth_more_or_less_inside_is_a_false_claim(factor: float) -> None:
    false = claims(HOLLOW, factor * INNER.area, factor * dark_area())
    one, other = found(HOLLOW, false)
    assert one.startswith("meshes.0.shell.inside_m2: claimed")
    assert other.startswith("coverage.unreachable_inside_m2: claimed")


def test_an_inside_that_a_solid_has_not_is_a_false_claim() -> None:
    (one,) = found(OUTER, claims(OUTER, 0.2 * OUTER.area, 0.0))
    assert one.startswith("meshes.0.shell.inside_m2: claimed")


def test_one_claim_alone_is_not_enough() -> None:
    document = claims(HOLLOW, INNER.area, dark_area())
    del document["meshes"][0]["shell"]
    (one,) = found(HOLLOW, document)
    assert one.startswith("meshes.0.shell.inside_m2: claimed 0")


@pytest.mark.parametrize("stated", [True, False])
def test_a_target_of_the_outside_is_that_and_no_other(stated: bool) -> None:
    document = claims(HOLLOW, INNER.area, 0.0)
    if not stated:
        del (
            document["meshes"][0]["shell"],
            document["coverage"]["unreachable_inside_m2"],
        )
    outer = np.arange(len(HOLLOW.faces)) < len(OUTER.faces)
    height = HOLLOW.face_centroids[:, 2]
    right = np.where(outer, 0, -1)
    assert found(HOLLOW, document, "outside", right) == ()
    # Without 4 % of the outer wall, and with as much of the inner wall.
    for wrong in (
        np.where(outer & (height < 0.092), 0, -1),
        np.where(outer | (height > 0.088), 0, -1),
    ):
        told = found(HOLLOW, document, "outside", wrong)
        assert "requirements.target: is 'outside'" in told[0]


def test_the_lining_of_a_shell_with_a_mouth_is_no_outside() -> None:
    """It sees 0.067 of the sphere, near a twentieth; behind it all is free."""
    polar = np.radians(np.linspace(180.0, 30.0, 51))
    arc = np.stack([np.sin(polar), np.cos(polar)], axis=1)
    shell = turned(np.concatenate([0.1 * arc, 0.096 * arc[::-1]])[::-1])
    outer = np.linalg.norm(shell.face_centroids, axis=1) > 0.098
    low = shell.face_centroids[:, 2] < -0.085
    assert found(shell, silent(shell), "outside", np.where(outer, 0, -1)) == ()
    (told,) = found(shell, silent(shell), "outside", np.where(outer | low, 0, -1))
    assert "requirements.target: is 'outside'" in told


def test_faces_are_outside_or_not_as_a_whole() -> None:
    """Long triangles reach from a hole's mouth to its ground: centroids decide."""
    around = [(0.0, 0.0), (5.0, 0.0), (5.0, 9.0), (4.6, 9.0), (4.6, 0.4), (0.0, 0.4)]
    mesh = turned(0.01 * np.array(around)[::-1])
    at = np.arange(len(mesh.faces)), mesh.face_centroids
    inside = lies_inside(RayCaster(mesh), *at)
    assert 0.1 < mesh.face_areas[inside].sum() / mesh.area < 0.5
    # Of places anywhere on these faces, many are on the other side.
    samples = draw_samples(surface(mesh), "surface", 2000, 0)
    anywhere = lies_inside(RayCaster(mesh), samples.faces, samples.points)
    assert np.mean(anywhere != inside[samples.faces]) > 0.02
    assert found(mesh, silent(mesh), "outside", np.where(inside, -1, 0)) == ()


def test_the_shell_is_told_with_wall_and_share() -> None:
    line = shell_line(mesh_record(HOLLOW, shell_of(HOLLOW)))
    share = 100.0 * INNER.area / HOLLOW.area
    assert "hollow shell, wall about 4 mm" in line
    assert f"{share:.1f} % of the surface lies inside" in line
    assert f"{share:.1f} % in sealed cavities" in line
    assert shell_line(mesh_record(OUTER, shell_of(OUTER))) == ""


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("hollow shell", "12.5 cm² of it lies inside the hollow body"),
        ("solid with cavities", "12.5 cm² of it lies in cavities"),
    ],
)
def test_target_out_of_reach_is_said_to_lie_inside(
    handmade: Any, kind: str, words: str
) -> None:
    plan = handmade.build_plan()
    document = plan.to_document()
    target = document["coverage"]["target"] | {"reachable_by_projectors_m2": 1e-4}
    coverage = {"target": target, "unreachable_inside_m2": 12.5e-4}
    document["coverage"] = document["coverage"] | coverage
    document["meshes"] = [document["meshes"][0] | {"shell": {"kind": kind}}]
    document["reconstruction"] = None
    told = shortfalls(RigPlan.from_document(document, plan.surface))[0]
    dark = target["area_m2"] - target["reachable_by_projectors_m2"]
    assert words in told
    assert ("--target outside leaves out" in told) == (12.5e-4 > 0.5 * dark)
    for share, remedy in ((0.6, True), (0.4, False), (0.0, False)):
        coverage["unreachable_inside_m2"] = share * dark
        document["coverage"] |= coverage
        plan = RigPlan.from_document(document, plan.surface)
        told = shortfalls(plan)[0]
        assert ("lies in" in told) == (share > 0)
        assert ("What would help: --target outside leaves out" in told) == remedy
    # Of a target that is chosen already, that is no remedy.
    coverage["unreachable_inside_m2"] = 0.6 * dark
    document["coverage"] |= coverage
    document["surface"]["selection"] = {
        "kind": "outside",
        "source": None,
        "sha256": None,
        "n_faces": 1,
        "area_m2": 1e-4,
        "n_removed_by_repair": 0,
    }
    told = shortfalls(RigPlan.from_document(document, plan.surface))[0]
    assert "lies in" in told
    assert "--target outside" not in told
