# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Cameras: equations (9) and (10)
#
# How far apart may two cameras stand? Far apart is good: fewer cameras cover the
# object, and every camera costs images and time (the paper's eq. (8)). Too far, and
# their views part: what lies between is measured by neither. Lee & Krim (2014, section
# VI) write, for two cameras with centres $O_1$ and $O_2$ and a point $E$ where their
# views meet,
#
# $$d = \sqrt{D_1^2 + D_2^2 - 2 D_1 D_2 \cos \phi} \tag{9}$$
# $$d'^2 = d^2 - d''^2 \tag{10}$$
#
# with $D_i = |O_i E|$, $\phi$ the angle $O_1 E O_2$, and $d'$, $d''$ the baseline's
# parts across and along the axis of camera 1. "If $d'^2 \ge d^2 - d''^2$, then the
# viewpoints are so far from each other that the object cannot be fully covered by
# them."
#
# Read literally, (10) is Pythagoras and never fails. It says something if $d$ in it is
# the *largest* baseline, that of (9) with the largest angle $\phi_{max}$ at which both
# cameras still reach $E$:
#
# $$d_{max}^2 = D_1^2 + D_2^2 - 2 D_1 D_2 \cos \phi_{max}, \qquad
#   \text{covered} \iff d'^2 < d_{max}^2 - d''^2 \iff d < d_{max}.$$
#
# It needs `pip install 'ringrig[plot]' pandas`.

# %%
import matplotlib.pyplot as plt
import numpy as np
import trimesh

from geometry import from_trimesh
from geometry.devices import PinholeModel
from geometry.poses import inverse, look_at, transform
from geometry.shapes.primitives import cylinder
from planning import load_rig, plan_rig
from planning.cameras.baselines.coverage_triangle import largest_baseline

UP = np.array([0.0, 0.0, 1.0])
s1, s2, b = 1.0, 0.8, np.radians(20.0)  # standoffs [m], half field of both cameras
C1, C2 = s1 * np.tan(b), s2 * np.tan(b)

fig, ax = plt.subplots(figsize=(7.5, 3.8))
O1, O2, E = np.array([0.0, s1]), np.array([C1 + C2, s2]), np.array([C1, 0.0])
foot = np.array([0.0, s2])
ax.plot([-0.45, 1.1], [0.0, 0.0], color="0.4", lw=3)
for centre, standoff in ((O1, s1), (O2, s2)):
    reach = standoff * np.tan(b)
    corners = [centre, (centre[0] - reach, 0.0), (centre[0] + reach, 0.0)]
    ax.fill(*zip(*corners, strict=True), color="C0", alpha=0.12)
    ax.plot([centre[0]] * 2, [centre[1], 0.0], "C0:", lw=1)
for start, end, label, shift in (
    (O1, E, "$D_1$", (-0.11, -0.05)),
    (O2, E, "$D_2$", (0.03, -0.05)),
    (O1, O2, "$d$", (0.0, 0.05)),
    (O1, foot, "$d''$", (-0.1, -0.05)),
    (foot, O2, "$d'$", (0.1, -0.07)),
):
    ax.plot(*zip(start, end, strict=True), color="C3" if label == "$d$" else "0.2")
    ax.text(*(0.5 * (start + end) + shift), label, fontsize=12)
for point, label, shift in (
    (O1, "$O_1$", (-0.08, 0.02)),
    (O2, "$O_2$", (0.02, 0.02)),
    (E, "$E$", (-0.02, -0.1)),
    (0.94 * E + 0.06 * (O1 + O2), r"$\phi$", (-0.02, 0.06)),
):
    ax.text(*(point + shift), label, fontsize=12)
ax.annotate("", (0.0, -0.14), (C1, -0.14), arrowprops={"arrowstyle": "<->"})
ax.annotate("", (C1, -0.14), (C1 + C2, -0.14), arrowprops={"arrowstyle": "<->"})
ax.text(0.5 * C1, -0.25, "$C_1$", fontsize=12)
ax.text(C1 + 0.5 * C2, -0.25, "$C_2$", fontsize=12)
ax.set_aspect("equal")
ax.set(ylim=(-0.28, 1.12))
ax.set_axis_off()

# %% [markdown]
# ## Three shapes, by brute force
#
# Where axes are square to the surface and fields end at $b$, $D_i = s_i / \cos b$ with
# $s_i$ the standoff, and $\phi_{max} = 2b + \delta$ over an edge that turns by
# $\delta$; on a wall that comes to $d'_{max} = C_1 + C_2$. Round a body of radius
# $\rho$ cameras on a ring of radius $S$ see up to an incidence $\theta$, so $\phi_{max}
# = 2 \theta$ and $D = S \sin(\eta) / \sin(\theta)$, with $\eta = \theta -
# \arcsin(\frac{\rho}{S} \sin \theta)$ what a camera covers to either side of itself.
#
# Nothing of that goes into the other column: two cameras are moved apart until some
# point between them projects into neither image, or is met at too large an angle.

# %%
focal = 500.0 / np.tan(b)
K = np.array([[focal, 0.0, 499.5], [0.0, focal, 499.5], [0.0, 0.0, 1.0]])
lens = PinholeModel(K, (1000, 1000), (0.1, 5.0))
theta, rho, S, delta = np.radians(60.0), 0.25, 1.0, np.radians(90.0)
t = np.linspace(0.0, 0.6, 6001)[1:, None]
x, y, turn = np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.radians(60.0 * t / 0.6)
arc = np.vstack([-turn[::-1], turn])


def wall(place):
    points = t * x
    pair = [(-s1 * y, 0.0 * y), (place * x - s2 * y, place * x)]
    return pair, points[t[:, 0] < place], np.tile(-y, ((t[:, 0] < place).sum(), 1))


def edge(place):
    near1, near2 = t[:, 0] < C1, t[:, 0] < place
    points = np.vstack([-t[near1] * x, t[near2] * y])
    normals = np.repeat([-y, x], [near1.sum(), near2.sum()], axis=0)
    return (
        [(-C1 * x - s1 * y, -C1 * x), (s2 * x + place * y, place * y)],
        points,
        normals,
    )


def round_body(place):
    normals = np.hstack([np.sin(arc), -np.cos(arc), 0.0 * arc])
    normals = normals[np.abs(arc[:, 0]) < place]
    sides = np.array([-place, place])[:, None]
    stands = S * np.hstack([np.sin(sides), -np.cos(sides), 0.0 * sides])
    return [(stand, 0.0 * x) for stand in stands], rho * normals, normals


def baseline(shape, place):
    (one, _), (two, _) = shape(place)[0]
    return np.linalg.norm(one - two)


def covers(shape, place, by_incidence):
    pair, points, normals = shape(place)
    seen = np.zeros(len(points), dtype=bool)
    for centre, aim in pair:
        back = centre - points
        cosine = np.sum(back * normals, axis=1) / np.linalg.norm(back, axis=1)
        if by_incidence:
            seen |= cosine >= np.cos(theta)
        else:
            inside = lens.in_field(transform(inverse(look_at(centre, aim, UP)), points))
            seen |= inside & (cosine > 0.0)
    return seen.all()


def widest(shape, by_incidence=False):
    """The baseline at which two cameras part, by bisection."""
    low, high = 0.1, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = covers(shape, middle, by_incidence)
        low, high = (middle, high) if inside else (low, middle)
    return baseline(shape, low)


eta = theta - np.arcsin(rho / S * np.sin(theta))
D1, D2 = s1 / np.cos(b), s2 / np.cos(b)
D = S * np.sin(eta) / np.sin(theta)
by_equation = {
    "wall": (widest(wall), largest_baseline(D1, D2, 2.0 * b)),
    "edge": (widest(edge), largest_baseline(D1, D2, 2.0 * b + delta)),
    "round": (widest(round_body, True), largest_baseline(D, D, 2.0 * theta)),
}
print("         parted at [m]   d_max by (9) [m]")
for name, (found, limit) in by_equation.items():
    print(f"{name:8s} {found:13.4f} {float(limit):18.4f}")

# %% [markdown]
# ## The same by ringrig
#
# Devices that stand already are `[[existing]]` tables of a rig file; with
# `max_projectors=None` a rig is evaluated as it stands. Two cameras with the paper's
# focal length of 8000 px stand 1 m before a wall of 400 x 80 mm. Their images are 160
# mm wide there, so $d'_{max} = C_1 + C_2 = 160$ mm. Up to there two cameras a distance
# $d$ apart measure $d + 160$ mm of the wall, beyond it no more than 320 mm, with a hole
# between.

# %%
slab = trimesh.creation.box((400, 10, 80)).subdivide().subdivide().subdivide()
slab = from_trimesh(slab, unit="mm")
front = slab.face_normals[:, 1] < -0.9


def two_cameras(apart_mm):
    """Evaluate cameras so far apart, and a projector under them."""
    devices = [
        {"name": "left", "kind": "camera", "x": -0.5 * apart_mm, "z": 0.0},
        {"name": "right", "kind": "camera", "x": 0.5 * apart_mm, "z": 0.0},
        {"name": "light", "kind": "projector", "x": 0.0, "z": -500.0},
    ]
    existing = [
        {
            "name": device["name"],
            "kind": device["kind"],
            "position_mm": [device["x"], -1005.0, device["z"]],
            "aim_mm": [device["x"], -5.0, 0.0],
            "origin": "mesh",
        }
        for device in devices
    ]
    rig = load_rig(
        {
            "base": "default",
            "name": "two cameras before a wall",
            "light": "parallel",
            "camera": {
                "name": "1280 x 720 px, f = 8000 px, as the paper's calibration",
                "resolution_px": [1280, 720],
                "focal_px": [8000.0, 8000.0],
                "range_mm": [100.0, 5000.0],
            },
            "limits": {"max_sigma_mm": "off", "min_ring_pitch_px": "off"},
            "existing": existing,
        }
    )
    asked = {"max_projectors": None, "select": front, "check": False}
    return plan_rig(slab, rig, **asked, on_miss="return")


stood = {apart: two_cameras(apart) for apart in (100, 130, 158, 180)}
print("  d [mm]  measured [mm]  expected   d_max of its seam [mm]")
for apart, plan in stood.items():
    width = 1e3 * plan.coverage.target.measured_m2 / 0.080
    seams = [f"{1e3 * row.d_max:.1f}" for row in plan.document.baselines]
    print(
        f"{apart:8d} {width:14.1f} {160 + min(apart, 160):9d}   "
        f"{', '.join(seams) or 'none: the views have parted'}"
    )

# %% [markdown]
# A seam is found on samples of the surface, and the row shows the sample with the least
# room, so $d_{max}$ is understated by up to a sample's distance, here 2 mm.
#
# ## How many it takes
#
# If neighbours must stand closer than $d_{max}$, a full turn takes $n_{min} = \lfloor
# \pi / \eta \rfloor + 1$ cameras. For a cylinder of radius 100 mm and 1 m of standoff,
# $\theta = 60$ degrees, three cameras reach 92.5 % of the turn, so where 95 % are asked
# it takes four. The planner, which knows no cylinder and may place cameras anywhere
# about it, has to find that number and to prove it.

# %%
drum = cylinder(0.1, 0.06)
side = np.abs(drum.face_normals[:, 2]) < 0.1
rig = load_rig("default", light="parallel").replace(
    limits={
        "max_sigma_mm": "off",
        "min_ring_pitch_px": "off",
        "camera_max_incidence_deg": 60.0,
    },
)
planned = plan_rig(
    drum,
    rig,
    max_projectors=4,
    select=side,
    dominant_coverage=0.99,
    coverage=0.95,
    region_coverage=0.0,
    prove=True,
    check=False,
    on_miss="return",
)
far = 1e-3 * rig.table.placement.standoff_mm + 0.1
reach = theta - np.arcsin(0.1 / far * np.sin(theta))
n_min = int(np.pi // reach) + 1
proof = planned.document.certificates.cameras
print(
    f"eta = {np.degrees(reach):.1f} degrees: three cameras reach "
    f"{3 * reach / np.pi:.1%}, n_min = {n_min}"
)
print(
    f"planned: {proof.count} cameras, at least {proof.candidates.lower_bound} over "
    f"{proof.candidates.n_candidates} candidates and {proof.continuous.lower_bound} "
    f"over every pose ({proof.continuous.status})"
)

# %%
planned.draw()

# %% [markdown]
# Of all sets of four, the one whose smallest baseline is largest was sought, as far as
# coverage allows. Each row below is a seam of two neighbours, in either order: $d$
# stays below the $d_{max}$ of (9). Its last column is what sets $\phi_{max}$:
# incidence, as in the closed form, or the border of an image. Cameras off the level of
# the drum's middle have other $D_i$ and other planes, so their $d_{max}$ isn't that of
# the ring. [Baselines](../docs/method/baselines.md) has the signed angles behind
# $\phi_{max}$, and what the paper leaves open.

# %%
rows = planned.document.baselines
print(f"{'seam':10s}{'d':>8s}{'d_max':>8s}  phi, phi_max   limit")
for row in rows:
    print(
        f"{' '.join(row.cameras):10s}{1e3 * row.d:8.0f}{1e3 * row.d_max:8.0f}"
        f"{np.degrees(row.phi):7.1f} {np.degrees(row.phi_max):6.1f}   {row.limit}"
    )
print(f"of a ring of cameras: d_max = {2e3 * far * np.sin(reach):.0f} mm")

# %%
for found, limit in by_equation.values():
    assert abs(found / limit - 1.0) < 1e-3
for apart, plan in stood.items():
    width = plan.coverage.target.measured_m2 / 0.080
    assert abs(width - 1e-3 * (160 + min(apart, 160))) < 1.5e-3
    seams = plan.document.baselines
    assert bool(seams) == (apart < 160)
    assert all(0.156 < row.d_max < 0.161 and row.covered for row in seams)
assert proof.count == n_min
assert proof.candidates.lower_bound == proof.continuous.lower_bound == n_min
assert rows
assert all(row.d < row.d_max for row in rows if row.covered)
