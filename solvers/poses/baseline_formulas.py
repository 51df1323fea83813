"""Formulas of the constraints in ``baseline_program``: of variables v and data q.

Symbols are those of its docstring; each is differentiated once (``baseline_rows``).
"""

import casadi as ca

# Keeps the root of |v|^2 smooth where it vanishes.
_SMOOTH = 1e-12


def apart(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return |O_a - O_b| - t, with v = (O_a, O_b, t)."""
    return ca.norm_2(v[:3] - v[3:6]) - v[6]


def distance(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return |O - C|, with q = C."""
    return ca.norm_2(v - q)


def in_cone(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return axis.(O - C) - cos(half angle) |O - C|, with q = (C, axis, cosine)."""
    offset = v - q[:3]
    return ca.dot(offset, q[3:6]) - q[6] * ca.norm_2(offset)


def height(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return n.(O - C), with q = (C, n)."""
    return ca.dot(v - q[:3], q[3:6])


def square(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return |O - O_start|^2."""
    return ca.sumsqr(v - q)


def margins(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return theta - iota_i and b_i - beta_i of both cameras at a seam point, (4,)."""
    point, outward, onward, turn = q[:3], q[3:6], q[6:9], q[9]
    half1, half2, aim1, aim2, theta = q[10], q[11], q[12:15], q[15:18], q[18]

    def bearing(u: ca.SX) -> ca.SX:
        return ca.atan2(ca.dot(u, onward), ca.dot(u, outward))

    one, two = v[:3], v[3:6]
    at1, at2 = bearing(one - point), bearing(two - point)
    back1, back2 = bearing(-_unit(aim1 - one)), bearing(-_unit(aim2 - two))
    return ca.vertcat(
        theta + at1, half1 - back1 + at1, theta - at2 + turn, half2 - at2 + back2
    )


def shared_margins(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return what each margin of camera 2 keeps of what camera 1 gives up, (4,)."""
    left, reserve = margins(v, q[:19]), q[19]
    return ca.vertcat(
        *(left[i] - reserve + left[j] for i in range(2) for j in range(2, 4))
    )


def held_view(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return `view` of a camera whose aim and roll stay: they are the end of q."""
    return view(ca.vertcat(v, q[16:20]), q[:16])


def view(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return what incidence, range and the four sides of the image leave, (7,).

    v = (O, aim, roll); q = (P, N, up, least x/z and y/z, largest, cos theta, range).
    """
    centre, aim, roll = v[:3], v[3:6], v[6]
    point, normal, up = q[:3], q[3:6], q[6:9]
    low, high, cosine, near, far = q[9:11], q[11:13], q[13], q[14], q[15]
    ray = point - centre
    distance = ca.norm_2(ray)
    margins = [
        -ca.dot(ray, normal) / distance - cosine,
        distance / near - 1.0,
        1.0 - distance / far,
    ]
    z = _unit(aim - centre)
    level = _unit(ca.cross(z, up))
    down = ca.cross(z, level)
    c, s = ca.cos(roll), ca.sin(roll)
    depth = ca.dot(ray, z) / distance
    across = c * level + s * down, c * down - s * level
    for least, most, side in zip(
        ca.vertsplit(low), ca.vertsplit(high), across, strict=True
    ):
        aside = ca.dot(ray, side) / distance
        margins.append((aside - least * depth) / ca.sqrt(1.0 + least**2))
        margins.append((most * depth - aside) / ca.sqrt(1.0 + most**2))
    return ca.vertcat(*margins)


def ring(v: ca.SX, q: ca.SX) -> ca.SX:
    """Return what |r.m|, s_N and ring pitch leave, (3,).

    q = (P, m, N, N.m, least |r.m|, q and p of the docstring).
    """
    point, m, normal, slant, least = q[:3], q[3:6], q[6:9], q[9], q[10]
    ray = point - v
    distance = ca.norm_2(ray)
    along, facing = ca.dot(ray, m) / distance, -ca.dot(ray, normal) / distance
    square = along**2 + facing**2 + 2.0 * along * facing * slant
    # v is null only where ring and surface are parallel; keep the root smooth there.
    spread = distance * ca.sqrt(square + _SMOOTH)
    return ca.vertcat(along - least, along - spread * q[11], facing - spread * q[12])


def _unit(a: ca.SX) -> ca.SX:
    return a / ca.norm_2(a)
