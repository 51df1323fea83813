"""Draw the dominant regions of the sample head and, if it is there, of a real scan.

Usage: python -m benchmarks.meshes.region_pictures [DATA]   (ringrig installed)

DATA is the folder with the shared meshes, `../shared/data` by default. Writes
docs/images/regions_faces.png: each head from the front and from its side.
"""

import sys
from pathlib import Path

from PIL import Image

from geometry.curvature.curvature import principal_curvatures
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.rays.rays import RayCaster
from geometry.regions.regions import dominant_regions
from planning.report.drawing.face_colours import region_colours
from planning.report.drawing.picture_view import fitted
from planning.report.drawing.shader import Shader

ROOT = Path(__file__).resolve().parents[2]
SIZE = (400, 500)
COLOURS = 128


def main() -> int:
    """Write the picture; return 0."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    heads = [(ROOT / "face.obj", (0, 0, 1), ((0.2, -1, 0.1), (1, -0.3, 0.1)))]
    scan = data / "meshes" / "face_scan_james.obj"
    if scan.is_file():
        heads.append((scan, (0, 1, 0), ((0.1, 0, 1), (1, 0, 0.3))))
    views: list[Image.Image] = []
    for path, up, directions in heads:
        mesh, _ = cut_for_curvature(load_mesh(path, unit="mm"))
        found = dominant_regions(mesh, principal_curvatures(mesh))
        print(
            f"{path.name}: {len(mesh.faces):,} faces, {len(found)} regions, "
            f"{found.dominant_share:.1%} of the area"
        )
        shader = Shader(RayCaster(mesh), region_colours(found.face_region))
        points = mesh.corners.reshape(-1, 3)
        for direction in directions:
            size = (2 * SIZE[0], 2 * SIZE[1])
            view = fitted(points, direction, up, size, margin_px=0.1 * SIZE[0])
            views.append(shader.shade(view).reduce(2))
    sheet = Image.new("RGB", (SIZE[0] * len(views), SIZE[1]))
    for i, view in enumerate(views):
        sheet.paste(view, (SIZE[0] * i, 0))
    target = ROOT / "docs" / "images" / "regions_faces.png"
    sheet.quantize(COLOURS).save(target, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
