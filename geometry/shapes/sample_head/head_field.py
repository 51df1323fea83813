"""The head as an implicit surface: rounded solids, smoothly joined and carved.

A head is the set where its field is negative. Joins are the cubic smooth minimum, so
the surface has continuous curvature wherever its solids have. Near the surface the
field is roughly the distance to it. Lengths in mm, in the frame of
`geometry.shapes.sample_head.sample_head`. Only correctly rounded arithmetic is used, so
that every machine gets the same numbers.
"""

from typing import TypeAlias

import numpy as np

from geometry.arrays import Array

from .head_shape import HeadShape

_Point: TypeAlias = tuple[float, float, float]
_Points: TypeAlias = tuple[Array, Array, Array]

# Half width of the strip in which |x| is rounded off, so that halves join smoothly.
_SEAM = 1.5
# The ear leans back by 12 degrees.
_EAR_COS, _EAR_SIN = 0.9781476, 0.2079117
_EYEBALL = 12.0


def head_field(shape: HeadShape, points: Array) -> Array:
    """Return the field of a head at points (n, 3) [mm]: negative inside, (n,)."""
    x = np.sqrt(points[:, 0] ** 2 + _SEAM**2) - _SEAM
    y, z = points[:, 1], points[:, 2]
    p = (x - _ear_relief(shape, (x, y, z)), y, z)
    field = _skull_and_jaw(shape, p)
    for add in (_brow_and_eyes, _nose, _mouth_and_chin):
        field = add(shape, p, field)
    return _carve(field, z - neck_base(shape), 14.0)


def neck_base(s: HeadShape) -> float:
    """Return the height of the plane where the neck ends, in [mm]."""
    return -s.face_length - s.neck_length


def _skull_and_jaw(s: HeadShape, p: _Points) -> Array:
    front, back, top = -0.5 * s.depth, 0.5 * s.depth, s.crown_height
    skull, cheek, jaw = 0.5 * s.width, 0.5 * s.cheek_width, 0.5 * s.jaw_width
    chin, k = -s.face_length, s.face_length / 113.0
    field = _ellipsoid(p, (0, 16, 34), (skull, back - 16, top - 34))
    forehead = _ellipsoid(p, (0, front + 72, 26), (skull - 10, 70, top - 30))
    face = _ellipsoid(p, (0, front + 64, -34 * k), (cheek - 7, 53, 64 * k))
    field = _join(_join(field, forehead, 30), face, 25)
    angle = (jaw - 14, -16.0, -70 * k)
    body = _rod(p, angle, (9, front + 21 - s.chin_projection, chin + 14), 13, 12)
    ramus = _rod(p, (cheek - 12, -4, -18), angle, 10, 13)
    field = _join(field, _join(body, ramus, 20), 30)
    cheeks = _ellipsoid(p, (jaw - 24, front + 45, -55 * k), (18, 26, 27))
    field = _join(field, cheeks, 28)
    mouth_floor = _rod(p, (0, 0, -85 * k), (0, front + 34, chin + 16), 22, 14)
    field = _join(field, mouth_floor, 25)
    neck = 0.5 * s.neck_width
    column = _rod(p, (0, 16, -40), (0, 22, neck_base(s) - 60), neck, neck + 4)
    field = _join(field, column, 30)
    cheekbone = _ellipsoid(p, (cheek - 25, front + 42, -24 * k), (19, 20, 13))
    return _join(field, cheekbone, 32)


def _brow_and_eyes(s: HeadShape, p: _Points, field: Array) -> Array:
    ridge, eye_x = -0.5 * s.depth - s.brow_ridge, 0.5 * s.eye_spacing
    eye_y = -0.5 * s.depth + s.eye_depth
    peak = (eye_x + 1, ridge + 14, 20.0)
    inner = _rod(p, (9, ridge + 11.5, 14), peak, 5.5, 5.5)
    outer = _rod(p, peak, (eye_x + 19, ridge + 37, 10), 5.5, 3)
    field = _join(field, _join(inner, outer, 12), 26)
    socket = _ellipsoid(p, (eye_x - 2, eye_y - 8, 1), (20, 13, 11))
    field = _carve(field, socket, 14)
    x, y, z = p[0] - eye_x, p[1] - eye_y - _EYEBALL, p[2]
    lids = _ellipsoid((x, y + 0.5, z), (0, 0, 0), (17.5, _EYEBALL + 1.2, 12.5))
    # The opening between the lids: where two discs overlap, extruded along y.
    lower = np.sqrt(x * x + (z - 14) ** 2) - 19.5
    upper = np.sqrt(x * x + (z + 10) ** 2) - 17.0
    opening = -_join(-lower, -upper, 1.5)
    field = _join(field, _carve(lids, opening, 2.5), 5)
    eyeball = _ellipsoid((x, y, z), (0, 0, 0), (16.5, _EYEBALL, 11.5))
    return _join(field, eyeball, 1.0)


def _nose(s: HeadShape, p: _Points, field: Array) -> Array:
    front, half, base = -0.5 * s.depth, 0.5 * s.nose_width, 4 - s.nose_length
    lip = front + 3.0
    tip = (0.0, lip - s.nose_projection + 9.5, base + 9)
    root = (0.0, front + 13, 3.0)
    middle = (
        0.0,
        0.55 * root[1] + 0.45 * tip[1] + 1 - s.nose_hump,
        0.45 * tip[2] + 1.65,
    )
    nose = _join(_rod(p, root, middle, 5.5, 7), _rod(p, middle, tip, 7, 8), 8)
    nose = _join(nose, _ellipsoid(p, tip, (10, 9.5, 9)), 5)
    columella = _rod(p, (0, tip[1] + 3, tip[2] - 2), (0, lip + 3, base + 3), 6, 6)
    nose = _join(nose, columella, 6)
    nose = _join(
        nose, _ellipsoid(p, (half - 6.5, lip - 1, base + 7), (6.5, 11, 7.5)), 5
    )
    flank = _rod(p, (8, front + 22, -5), (half - 7, lip + 4, base + 11), 4, 7)
    field = _join(field, _join(nose, flank, 9), 9)
    nostril = _ellipsoid(p, (7.5, lip - 5, base - 1), (3.4, 5, 3.5))
    return _carve(field, nostril, 3)


def _mouth_and_chin(s: HeadShape, p: _Points, field: Array) -> Array:
    front, half, red = -0.5 * s.depth, 0.5 * s.mouth_width, s.lip_fullness
    middle, lips = -74.0 * s.face_length / 113.0, front + 1.5
    field = _join(field, _ellipsoid(p, (0, front + 25, middle + 3), (26, 22, 20)), 20)
    corner = (half - 2, lips + 12.0, middle + 0.5)
    upper = _rod(p, (3, lips + 1, middle + 0.36 * red), corner, 0.46 * red, 1.5)
    lower = _rod(p, (0, lips + 0.5, middle - 0.58 * red), corner, 0.62 * red, 1.5)
    field = _join(_join(field, upper, 7), lower, 5)
    parting = _rod(p, (0, lips - 5, middle), (half, lips + 8, middle + 0.5), 1.4, 1.4)
    field = _carve(field, parting, 4)
    philtrum_top = (0.0, front - 1.5, -3 - s.nose_length)
    philtrum = _rod(p, philtrum_top, (0, front - 4, middle + red), 2, 2)
    field = _carve(field, philtrum, 4)
    out, chin = front - s.chin_projection, -s.face_length + 14
    field = _join(field, _ellipsoid(p, (0, out + 16, chin), (17, 12, 13)), 14)
    height = middle - 1.9 * red
    furrow = _rod(p, (0, front - 4, height), (14, front - 2, height), 5, 5)
    return _carve(field, furrow, 9)


def _ear_relief(s: HeadShape, p: _Points) -> Array:
    """How far the ear lifts the side of the head outwards in [mm], shape (n,).

    A relief over the (y, z) plane: a disc that rises from its front edge to its rear
    rim, with a raised helix and a hollow bowl.
    """
    half = 0.5 * s.ear_height
    y, z = p[1] - 16.0, p[2] + 6.0
    up = (z * _EAR_COS + y * _EAR_SIN) / half
    rear = (y * _EAR_COS - z * _EAR_SIN) / half / (0.56 + 0.14 * up)
    radius = np.sqrt(rear * rear + up * up)
    disc = _fade(radius, 0.84, 1.12)
    helix = _fade(np.abs(radius - 0.80), 0.0, 0.30) * _fade(-rear, 0.1, 1.0)
    bowl = _fade(_radius(rear + 0.12, 0.62, up + 0.12, 0.5), 0.45, 1.0)
    hollow = _fade(_radius(rear, 0.7, up - 0.5, 0.35), 0.3, 1.0)
    rise = 0.65 + 0.35 * np.clip(rear, -1.0, 1.4)
    height = rise + 0.16 * helix - 0.5 * bowl - 0.15 * hollow
    at_the_side = _fade(-p[0], -55.0, -43.0)
    return s.ear_standoff * disc * height * at_the_side


def _radius(a: Array, a_scale: float, b: Array, b_scale: float) -> Array:
    return np.sqrt((a / a_scale) ** 2 + (b / b_scale) ** 2)


def _fade(value: Array, full: float, none: float) -> Array:
    """1 up to `full`, 0 from `none` on, twice continuously differentiable between."""
    t = np.clip((value - full) / (none - full), 0.0, 1.0)
    return 1.0 - t * t * t * (10.0 + t * (6.0 * t - 15.0))


def _join(a: Array, b: Array, width: float) -> Array:
    """Smooth minimum: union, rounded where the two fields differ by less than width."""
    blend = np.maximum(width - np.abs(a - b), 0.0)
    return np.minimum(a, b) - blend * blend * blend * (1.0 / (6.0 * width * width))


def _carve(field: Array, tool: Array, width: float) -> Array:
    """Smooth difference: what `tool` holds is taken away; for a plane, pass height."""
    return -_join(-field, tool, width)


def _ellipsoid(p: _Points, centre: _Point, radii: _Point) -> Array:
    """First-order distance to an ellipsoid: k0 (k0 - 1) / k1."""
    scaled = [(v - c) / r for v, c, r in zip(p, centre, radii, strict=True)]
    k0 = np.sqrt(sum(v * v for v in scaled))
    k1 = np.sqrt(sum((v / r) ** 2 for v, r in zip(scaled, radii, strict=True)))
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def _rod(p: _Points, a: _Point, b: _Point, radius_a: float, radius_b: float) -> Array:
    """Distance to the segment from a to b, less a radius that varies along it."""
    along = [end - start for start, end in zip(a, b, strict=True)]
    away = [v - start for v, start in zip(p, a, strict=True)]
    t = sum(u * v for u, v in zip(along, away, strict=True))
    t = np.clip(t / sum(u * u for u in along), 0.0, 1.0)
    square = sum((v - t * u) ** 2 for u, v in zip(along, away, strict=True))
    return np.sqrt(square) - (radius_a + (radius_b - radius_a) * t)
