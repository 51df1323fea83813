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
# # Curvature and regions
#
# Where must a projector look? Lee & Krim (2014, section III) answer with curvature:
# what tells one object from another lies where its surface bends, and light that comes
# along the surface there is lost. With the tangents $T_1, T_2$ of a point and their
# curvature
#
# $$\vec{T}_p = (\vec{T}_{p1}, \vec{T}_{p2}), \qquad
#   \kappa_p = \left\| \frac{d\vec{T}_p}{ds} \right\| \tag{1}$$
#
# "the optimal number of projectors is directly dependent on the number of areas which
# have high curvatures". This notebook computes $\kappa$ on meshes, holds it against a
# shape whose curvature is known, and cuts what is most curved into regions.
#
# It needs `pip install 'ringrig[plot]'`.

# %%
import matplotlib.pyplot as plt
import numpy as np
import trimesh
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from geometry import dominant_regions, from_trimesh, principal_curvatures
from geometry.shapes.sample_head.sample_head import sample_head


def show(ax, mesh, colours, *, elevation, azimuth, zoom=1.2):
    """Draw a mesh with a colour for each face, shaded by a lamp beside the viewer."""
    a, e = np.radians([azimuth - 30.0, elevation + 20.0])
    lamp = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    bright = 0.4 + 0.6 * np.clip(mesh.face_normals @ lamp, 0.0, 1.0)
    shaded = np.clip(colours[:, :3] * bright[:, None], 0.0, 1.0)
    ax.add_collection3d(
        Poly3DCollection(mesh.corners, facecolors=shaded, edgecolors=shaded, lw=0.2)
    )
    low, high = mesh.bounds
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=zoom)
    ax.view_init(elev=elevation, azim=azimuth)
    ax.set_axis_off()


# %% [markdown]
# ## A shape whose curvature is known
#
# A surface bends by two *principal curvatures*, the largest and the smallest of all
# curves through a point. On a torus of radii $R$ and $r$ they are
#
# $$k_1 = \frac{1}{r}, \qquad k_2 = \frac{\cos v}{R + r \cos v},$$
#
# with $v$ the angle about the tube: $k_2$ is positive on the outside, zero on top, and
# negative inside, where the surface is a saddle. `principal_curvatures` fits quadrics
# to the triangles (libigl) and averages them at a physical scale, so that finer
# triangles give the same answer. How much a point is bent at all is the *curvedness*
# $\sqrt{(k_1^2 + k_2^2)/2}$, the scalar that stands for $\kappa_p$ of (1).

# %%
R, r = 0.060, 0.025


def torus(around, across):
    """A torus in metres, its curvatures as computed, and v of each vertex."""
    mesh = from_trimesh(trimesh.creation.torus(R, r, around, across), unit="m")
    x, y, z = mesh.vertices.T
    return mesh, principal_curvatures(mesh), np.arctan2(z, np.hypot(x, y) - R)


def wrong_by(field, v):
    """Root mean square error of k1 and k2, of the largest curvature."""
    k2 = np.cos(v) / (R + r * np.cos(v))
    errors = np.stack([field.k_max - 1.0 / r, field.k_min - k2])
    return r * np.sqrt(np.mean(errors**2, axis=1))


print("faces    error of k1    of k2")
for around, across in ((40, 20), (80, 40), (160, 80)):
    mesh, field, v = torus(around, across)
    e1, e2 = wrong_by(field, v)
    print(f"{len(mesh.faces):5d} {e1:13.2%} {e2:9.2%}")

# %%
fig = plt.figure(figsize=(9.5, 3.6))
shape = fig.add_subplot(1, 2, 1, projection="3d")
curvedness = field.curvedness[mesh.faces].mean(axis=1)
scale = plt.Normalize(curvedness.min(), curvedness.max())
show(shape, mesh, plt.cm.viridis(scale(curvedness)), elevation=42.0, azimuth=-60.0)
fig.colorbar(plt.cm.ScalarMappable(scale), ax=shape, label="curvedness [1/m]")
ax = fig.add_subplot(1, 2, 2)
turn = np.linspace(-np.pi, np.pi, 200)
ax.axhline(1.0 / r, color="C0", label="$k_1 = 1/r$")
ax.plot(
    np.degrees(turn),
    np.cos(turn) / (R + r * np.cos(turn)),
    color="C1",
    label=r"$k_2 = \cos v / (R + r \cos v)$",
)
ax.plot(np.degrees(v), field.k_max, "k.", ms=2)
ax.plot(np.degrees(v), field.k_min, "k.", ms=2, label="computed")
ax.set(xlabel="angle $v$ about the tube [degrees]", ylabel="curvature [1/m]")
ax.set_xticks(range(-180, 181, 90))
ax.legend(loc="center", bbox_to_anchor=(0.5, 0.77))
fig.tight_layout()

# %% [markdown]
# ## What is dominant
#
# `dominant_regions` takes the share of the area with the highest curvedness, and cuts
# it into *regions*: connected pieces whose normals fit a cone of 50 degrees, so that
# one projector can meet a whole piece at angles that rings survive.
#
# On an egg, a spheroid of half axes $a$ and $c > a$, the answer is known: the two tips,
# one region each. With $t$ from the axis, $x = a \sin t$ and $z = c \cos t$, the tenth
# of the area with the highest curvedness is where $t < t_0$ or $t > \pi - t_0$,
#
# $$\frac{\int_0^{t_0} g(t)\, dt}{\int_0^{\pi/2} g(t)\, dt} = 0.1, \qquad
#   g(t) = \sin t\, \sqrt{a^2 \cos^2 t + c^2 \sin^2 t}.$$

# %%
a, c = 0.040, 0.064
ball = trimesh.creation.icosphere(subdivisions=5)
egg = from_trimesh(ball.apply_scale([a, a, c]), unit="m")
regions = dominant_regions(egg, principal_curvatures(egg), area_share=0.1)

t = np.linspace(0.0, np.pi / 2.0, 100_001)
area = np.cumsum(np.sin(t) * np.hypot(a * np.cos(t), c * np.sin(t)))
t0 = t[np.searchsorted(area, 0.1 * area[-1])]
tips = np.abs(egg.corners.mean(axis=1)[:, 2]) > c * np.cos(t0)
taken = regions.face_region >= 0
agreed = egg.face_areas[tips & taken].sum() / egg.face_areas[tips | taken].sum()
print(f"t0 = {np.degrees(t0):.1f} degrees; {agreed:.1%} of tips and regions in common")
for region in regions:
    print(
        f"region {region.id}: {1e4 * region.area_m2:.1f} cm², looks along "
        f"{np.round(region.mean_normal, 3) + 0.0}, normals within "
        f"{np.degrees(region.cone_angle):.1f} degrees of that"
    )


def coloured(regions):
    """A colour for each face: its region, grey where it is in none."""
    colours = plt.cm.tab10([0, 1, 2, 3, 4, 5, 6, 8, 9])
    palette = np.vstack([colours, [[0.82, 0.80, 0.78, 1.0]]])
    return palette[np.where(regions.face_region < 0, 9, regions.face_region % 9)]


fig = plt.figure(figsize=(3.5, 3.2))
ax = fig.add_subplot(projection="3d")
show(ax, egg, coloured(regions), elevation=0.0, azimuth=-60.0, zoom=1.3)

# %% [markdown]
# ## A head
#
# The sample that ships with ringrig, and the fifth that `plan` takes: nose, eyes, lips,
# chin and ears come out, cheeks and the back of the head don't. These regions are its
# target, unless you choose another: `--target surface` for everything, `--select` or
# `--weight` for faces of your own ([how](../docs/use/target.md)).

# %%
head = sample_head(n_faces=20_000, open_neck=True)
of_head = dominant_regions(head, principal_curvatures(head))
print(f"{len(of_head)} regions, {of_head.dominant_share:.1%} of the area")
fig = plt.figure(figsize=(9.0, 4.0))
for place, azimuth in enumerate((-90.0, -20.0, 200.0), 1):
    ax = fig.add_subplot(1, 3, place, projection="3d")
    show(ax, head, coloured(of_head), elevation=5.0, azimuth=azimuth, zoom=1.4)
fig.tight_layout()

# %% [markdown]
# A region's axis is where light should come from: a beam along minus the mean normal
# meets 98 % of the region's area within the angle of its cone, as (2) asks,
# $\langle \vec{N}_p, \vec{L} \rangle < 0$ with a margin. The
# [next notebook](02_projectors.ipynb) takes it from there.

# %%
for region in of_head:
    normals, areas = head.face_normals[region.faces], head.face_areas[region.faces]
    met = normals @ region.mean_normal >= np.cos(region.cone_angle) - 1e-9
    assert areas[met].sum() >= 0.98 * areas.sum()
assert max(wrong_by(field, v)) < 0.005  # of the largest curvature, on the finest torus
assert np.sign(field.k_min[np.abs(v) > 2.0]).max() < 0.0  # a saddle inside
assert len(regions) == 2
assert all(abs(region.mean_normal[2]) > 0.999 for region in regions)
assert agreed > 0.9
assert 0.15 < of_head.dominant_share < 0.25
