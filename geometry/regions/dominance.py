"""Which faces are dominant: the highest curvedness, whole plateaus, no small parts."""

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.curvature.curvature import CurvatureField
from geometry.curvature.face_curvature import FLAT, averaged_on_faces
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import components

# Curvedness is averaged over a length that is this share of its scale.
_AVERAGED_SHARE = 1.5
# Times the scale: what is sharper is an edge, and by how much is the triangles' choice.
_SHARPEST = 0.5
# The cut must not run through equal curvedness: faces this little below it are taken
# too, and so many more the more of the area lies in a band about it. Between the two
# shares the step grows evenly, so that no small change of the mesh makes it jump.
_TIE_BAND, _PLATEAU_BAND = 0.02, 0.1
_PLATEAU_SHARES = (0.15, 0.35)


def face_curvedness(mesh: TriangleMesh, field: CurvatureField) -> tuple[Array, Mask]:
    """Return the curvedness [1/m] by which faces are ranked, and its trust, (n_f,).

    sqrt((k1^2 + k2^2) / 2) of each vertex, no more than half over the field's scale,
    averaged by diffusion over 1.5 scales. Without sign: a ball in a socket stays
    curved. A sharp edge measures at anything above the limit, by its triangles; with
    it all sharp edges are alike. 0 where it isn't trusted or flat.
    """
    capped = np.minimum(field.curvedness, _SHARPEST / field.scale)[:, None]
    averaged, trusted = averaged_on_faces(mesh, field, capped, _AVERAGED_SHARE)
    curvedness = averaged[:, 0]
    curved = trusted & (curvedness * mesh.size > FLAT)
    return np.where(curved, curvedness, 0.0), trusted


def dominant_faces(
    mesh: TriangleMesh,
    curvedness: Array,
    trusted: Mask,
    pairs: Ints,
    area_share: float,
    least: float,
) -> Mask:
    """Return which faces are dominant, shape (n_f,).

    Curvedness and trust are those of `face_curvedness`, pairs (m, 2) are adjacent
    faces. Islands, holes and bodies below the least area [m²] are small components.
    """
    judged = trusted & _on_main_bodies(mesh, least)
    judged = judged if judged.any() else np.ones(len(mesh.faces), dtype=bool)
    dominant = judged & (curvedness >= _cut(mesh, curvedness, judged, area_share))
    if dominant[judged].all():
        # Uniform: the rim, whose curvature isn't known, is no less dominant.
        dominant = judged = np.ones(len(mesh.faces), dtype=bool)
    return _without_small_components(mesh, dominant, judged, pairs, least)


def _on_main_bodies(mesh: TriangleMesh, least: float) -> Mask:
    """Faces of bodies that can hold a region: a fragment would take up the share."""
    count, label = components(mesh.edges.ends, len(mesh.vertices))
    body = label[mesh.faces[:, 0]]
    return np.bincount(body, mesh.face_areas, count)[body] >= least


def _cut(
    mesh: TriangleMesh, curvedness: Array, judged: Mask, area_share: float
) -> float:
    """Curvedness from which a face is dominant; below a plateau, never through it."""
    faces = np.flatnonzero(judged)
    order = faces[np.argsort(-curvedness[faces], kind="stable")]
    area = np.cumsum(mesh.face_areas[order])
    cut = float(curvedness[order[np.searchsorted(area, area_share * area[-1])]])
    curved = curvedness[judged & (curvedness > 0.0)]
    if not cut > 0.0 and len(curved):
        # Less than the share is curved at all: flat surface doesn't fill it up.
        return float(curved.min())
    near = judged & (np.abs(curvedness - cut) <= _PLATEAU_BAND * cut)
    share = float(mesh.face_areas[near].sum() / area[-1])
    band = np.interp(share, _PLATEAU_SHARES, (_TIE_BAND, _PLATEAU_BAND))
    return cut * (1.0 - float(band))


def _without_small_components(
    mesh: TriangleMesh, dominant: Mask, judged: Mask, pairs: Ints, least: float
) -> Mask:
    """Fill small holes of trusted surface, then drop small islands."""
    for state in (False, True):
        same = pairs[
            (dominant[pairs[:, 0]] == state) & (dominant[pairs[:, 1]] == state)
        ]
        count, label = components(same, len(dominant))
        area = np.bincount(label, mesh.face_areas, count)
        small = (dominant == state) & judged & (area[label] < least)
        if not state:
            # A hole has a dominant rim; a whole small body hasn't.
            mixed = pairs[dominant[pairs[:, 0]] != dominant[pairs[:, 1]]]
            rimmed = np.zeros(count, dtype=bool)
            rimmed[label[mixed.ravel()]] = True
            open_ended = np.zeros(count, dtype=bool)
            open_ended[label[~judged]] = True
            small &= rimmed[label] & ~open_ended[label]
        dominant = dominant ^ small
    return dominant
