"""Measure curvature on shapes whose curvature is known, and draw how it converges.

Usage: python -m benchmarks.meshes.curvature_accuracy   (from a checkout, ringrig
    installed)

Prints tables of errors (rms of k1 and of k2 over the largest curvature, rms angle of
k1's direction away from umbilics) of the clean route (a radius below an edge) and of
the default radius, on regular and irregular triangles in a random position, clean and
with vertex noise; and of the routes that weren't taken. Writes the figure
docs/images/curvature_convergence.png.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import igl
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation
from support import curved_shapes

from benchmarks.machine import machine
from geometry.curvature.curvature import CurvatureField, principal_curvatures
from geometry.mesh.diffusion import diffused
from geometry.mesh.mesh import TriangleMesh

ROOT = Path(__file__).resolve().parents[2]
FIGURE = ROOT / "docs" / "images" / "curvature_convergence.png"
FACES = 20_000
LADDER = (2_000, 5_120, 20_000, 81_920)
NOISE = (0.0, 1e-4, 1e-3)
TURN = Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()
INKS = ("#1b6ca8", "#c8553d", "#3a7d44", "#7d4e9f")

Found = tuple[np.ndarray, np.ndarray, np.ndarray]
_Point = tuple[float, float]
Route = Callable[[TriangleMesh], Found]


def main() -> int:
    """Print the tables and write the figure; return 0."""
    shapes = curved_shapes
    print(
        f"{machine()}\n\n"
        "Each entry: rms error of k1 / of k2 in % of the largest curvature, rms angle "
        "of k1's direction.\n"
    )
    for name, route in ROUTES.items():
        print(f"## {name}\n\nAbout {FACES:,} faces, in a random position.\n")
        print("| shape | triangles | clean | noise 0.01 % | noise 0.1 % of the size |")
        print("|---|---|---|---|---|")
        for shape in shapes.SHAPES:
            for kind in ("regular", "irregular"):
                row = [_measured(shapes, shape, kind, FACES, s, route) for s in NOISE]
                print(f"| {shape} | {kind} | " + " | ".join(map(_cell, row)) + " |")
        print(flush=True)
    _converge(shapes)
    return 0


def clean_route(mesh: TriangleMesh) -> Found:
    """A radius below an edge."""
    field = principal_curvatures(mesh, radius=0.5 * mesh.mean_edge)
    return _of(field)


def default_route(mesh: TriangleMesh) -> Found:
    """No radius given."""
    return _of(principal_curvatures(mesh))


def plain_route(mesh: TriangleMesh) -> Found:
    """The quadric of libigl over two rings alone."""
    valid = principal_curvatures(mesh, radius=0.5 * mesh.mean_edge).valid
    return *_quadric(mesh, mesh.vertices / mesh.mean_edge), valid


def moved_route(mesh: TriangleMesh) -> Found:
    """Positions diffused over half the default radius, then that quadric."""
    valid = principal_curvatures(mesh).valid
    v = mesh.vertices / mesh.mean_edge
    length = 0.5 * 0.02 * mesh.size / mesh.mean_edge
    mass, laplacian = TriangleMesh(v, mesh.faces).vertex_areas, mesh.laplacian
    return *_quadric(mesh, diffused(v, mass, laplacian, length)), valid


def cotangent_route(mesh: TriangleMesh) -> Found:
    """Cotangent mean curvature and angle defect over Voronoi areas."""
    _, ways, valid = plain_route(mesh)
    v, f = np.array(mesh.vertices) / mesh.mean_edge, np.array(mesh.faces)
    area = igl.massmatrix(v, f, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    normals = igl.per_vertex_normals(v, f)
    flow = -(igl.cotmatrix(v, f) @ v) / area[:, None]
    mean = 0.5 * np.einsum("ij,ij->i", flow, normals)
    spread = np.sqrt(np.maximum(mean**2 - igl.gaussian_curvature(v, f) / area, 0.0))
    return np.stack([mean + spread, mean - spread]) / mesh.mean_edge, ways, valid


ROUTES: dict[str, Route] = {
    "The clean route: principal_curvatures(mesh, radius below an edge)": clean_route,
    "The default radius: principal_curvatures(mesh)": default_route,
    "Not taken: the quadric alone": plain_route,
    "Not taken: positions moved over half the radius, then the quadric": moved_route,
    "Not taken: cotangent mean curvature and angle defect": cotangent_route,
}


def _of(f: CurvatureField) -> Found:
    ways = np.stack([f.direction_max, f.direction_min])
    return np.stack([f.k_max, f.k_min]), ways, f.valid


def _quadric(mesh: TriangleMesh, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.ascontiguousarray(vertices - vertices.mean(axis=0))
    a, b, k1, k2, _ = igl.principal_curvature(vertices, mesh.faces, 2, True)
    return np.stack([k1, k2]) / mesh.mean_edge, np.stack([a, b])


def _measured(
    shapes: ModuleType, name: str, kind: str, n: int, noise: float, route: Route
) -> np.ndarray:
    shape = shapes.SHAPES[name]
    mesh = getattr(shape, kind)(n)
    truth = shape.truth(mesh.vertices)
    truth = (*truth[:2], truth[2] @ TURN.T, truth[3] @ TURN.T)
    moves = np.random.default_rng(0).normal(size=mesh.vertices.shape) / np.sqrt(3.0)
    vertices = mesh.vertices @ TURN.T + noise * mesh.size * moves
    return shapes.errors(truth, *route(TriangleMesh(vertices, mesh.faces)))


def _cell(errors: np.ndarray) -> str:
    k1, k2, angle = 100 * errors[0], 100 * errors[1], np.degrees(errors[2])
    return f"{k1:.2f} / {k2:.2f} %, {angle:.1f}°"


def _converge(shapes: ModuleType) -> None:
    """Print the errors of k1 by edge length with their order, and draw them."""
    print(
        "## Convergence\n\nThe larger error of k1 and k2 in %, by faces; the order is"
    )
    print("the slope of its logarithm against that of the edge, by least squares.\n")
    print("| route | shape | triangles | edges [mm] | errors | order |")
    print("|---|---|---|---|---|---|")
    panels = []
    for title, route in (("clean route", clean_route), ("default", default_route)):
        for kind in ("regular", "irregular"):
            lines = []
            for name, shape in shapes.SHAPES.items():
                edge = [1e3 * getattr(shape, kind)(n).mean_edge for n in LADDER]
                error = [
                    100 * _measured(shapes, name, kind, n, 0.0, route)[:2].max()
                    for n in LADDER
                ]
                order = float(np.polyfit(np.log(edge), np.log(error), 1)[0])
                words = [" ".join(f"{x:.2f}" for x in xs) for xs in (edge, error)]
                print(
                    f"| {title} | {name} | {kind} | {' | '.join(words)} | {order:.1f} |"
                )
                lines.append((f"{name}, order {order:.1f}", edge, error))
            panels.append((f"{title}, {kind} triangles", lines))
    _draw(panels)


def _draw(panels: list[tuple[str, list[tuple[str, list[float], list[float]]]]]) -> None:
    wide, tall, pad = 560, 400, 64
    image = Image.new("RGB", (2 * wide, 2 * tall), "white")
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(15)
    for p, (title, lines) in enumerate(panels):
        x0, y0 = (p % 2) * wide + pad, (p // 2) * tall + 36

        def at(edge: float, error: float, x: int = x0, y: int = y0) -> _Point:
            u = np.log10(edge / 0.8) / np.log10(20 / 0.8)
            v = np.log10(error / 0.01) / 3.3
            return x + u * (wide - pad - 20), y + (1 - v) * (tall - 100)

        pen.text((x0, y0 - 28), title, "black", font)
        for edge in (1, 2, 5, 10, 20):
            pen.line([at(edge, 0.01), at(edge, 20)], "#dddddd")
            pen.text(at(edge, 0.0095), f"{edge}", "black", font, anchor="mt")
        for error in (0.01, 0.1, 1, 10):
            pen.line([at(0.8, error), at(20, error)], "#dddddd")
            pen.text(
                (x0 - 6, at(1, error)[1]), f"{error:g}", "black", font, anchor="rm"
            )
        pen.text((x0 + 130, y0 + tall - 78), "edge [mm]", "black", font)
        pen.text((x0 - pad + 6, y0 - 28), "error", "black", font)
        pen.text((x0 - pad + 6, y0 - 12), "[%]", "black", font)
        for k, (name, edges, errors) in enumerate(lines):
            dots = [at(*pair) for pair in zip(edges, errors, strict=True)]
            pen.line(dots, INKS[k], 3)
            for x, y in dots:
                pen.ellipse([x - 4, y - 4, x + 4, y + 4], INKS[k])
            pen.text((x0 + 285, y0 + 216 + 20 * k), name, INKS[k], font)
    image.save(FIGURE, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
