"""Meshes, curvature, devices and rays; no optimisation."""

from importlib import import_module
from typing import TYPE_CHECKING

from ._siblings import check_siblings

if TYPE_CHECKING:
    from geometry.curvature.curvature import CurvatureField as CurvatureField
    from geometry.curvature.curvature import (
        principal_curvatures as principal_curvatures,
    )
    from geometry.files.interchange import from_trimesh as from_trimesh
    from geometry.files.interchange import to_trimesh as to_trimesh
    from geometry.files.readers import load_mesh as load_mesh
    from geometry.mesh.mesh import TriangleMesh as TriangleMesh
    from geometry.rays.rays import RayCaster as RayCaster
    from geometry.regions.regions import Region as Region
    from geometry.regions.regions import dominant_regions as dominant_regions
    from geometry.regions.selected_regions import regions_of_faces as regions_of_faces

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "CurvatureField": "curvature.curvature",
    "RayCaster": "rays.rays",
    "Region": "regions.regions",
    "TriangleMesh": "mesh.mesh",
    "dominant_regions": "regions.regions",
    "from_trimesh": "files.interchange",
    "load_mesh": "files.readers",
    "principal_curvatures": "curvature.curvature",
    "regions_of_faces": "regions.selected_regions",
    "to_trimesh": "files.interchange",
}


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_EXPORTS[name]}", __name__), name)


def __dir__() -> list[str]:
    return list(_EXPORTS)


check_siblings()
