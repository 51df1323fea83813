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
# # Projectors
#
# How many projectors does an object take, and where do they stand? Lee & Krim (2014,
# section III) demand of the direction $\vec{L}$ of the light, at every dominant point
# with normal $\vec{N}_p$ and tangents $\vec{T}_{p1}, \vec{T}_{p2}$,
#
# $$\vec{L} \neq k \vec{T}_{p1}, \qquad \vec{L} \neq k \vec{T}_{p2}, \qquad
#   \langle \vec{N}_p, \vec{L} \rangle < 0. \tag{2}$$
#
# "Not along a tangent" is measured with a margin: rings smear long before the light
# runs along the surface. ringrig lights a point only if the angle of incidence is at
# most
# $\theta$ (60 degrees unless the rig file says otherwise),
#
# $$-\langle \vec{N}_p, \vec{L} \rangle \ge \cos \theta,$$
#
# and only if nothing stands between. (The first two conditions of (2) follow from the
# third.) This notebook counts projectors where the right number is known, and where it
# isn't, reads off what was proved.
#
# It needs `pip install 'ringrig[plot]' pandas`.

# %%
import matplotlib.pyplot as plt
import numpy as np
import trimesh

from geometry import from_trimesh
from geometry.shapes.primitives import box
from planning import load_rig, plan_rig, sweep
from solvers.poses.cone import max_margin_direction

# %% [markdown]
# ## A box, by hand
#
# The paper's box has six faces and parallel light. A direction $\vec{L}$ lights a face
# with normal $\pm e_i$ where $|L_i| \ge \cos \theta$ (with the right sign), and
# $L_1^2 + L_2^2 + L_3^2 = 1$. So one projector lights
#
# - three faces if $\cos \theta \le 1/\sqrt{3}$, that is $\theta \ge 54.7$ degrees,
# - two faces if $\cos \theta \le 1/\sqrt{2}$, $\theta \ge 45$ degrees,
# - else one,
#
# and a box takes 2, 3 or 6 projectors. Below, every direction of light by the number of
# faces that it lights: corners of the box win at 60 degrees, edges at 50.

# %%
longitude, latitude = np.radians(np.mgrid[-180:180:361j, -90:90:181j])
towards = np.stack(
    [
        np.cos(latitude) * np.cos(longitude),
        np.cos(latitude) * np.sin(longitude),
        np.sin(latitude),
    ],
    axis=-1,
)
fig, axes = plt.subplots(1, 3, figsize=(10.0, 2.6), sharey=True)
for ax, theta in zip(axes, (60, 50, 40), strict=True):
    lit = (np.abs(towards) >= np.cos(np.radians(theta))).sum(axis=-1)
    levels = np.arange(-0.5, 4.0)
    drawn = ax.contourf(
        *np.degrees([longitude, latitude]), lit, levels, cmap="viridis", vmax=3.0
    )
    ax.set(title=f"$\\theta$ = {theta} degrees", xlabel="azimuth to the projector")
    ax.set_xticks(range(-180, 181, 90))
axes[0].set(ylabel="elevation")
bar = fig.colorbar(drawn, ax=axes, ticks=range(4), label="faces lit")

# %% [markdown]
# ## The best direction, with its proof
#
# Which direction meets three faces with the largest margin? For parallel light that is
# a convex program, and it comes with multipliers $a \ge 0$, $\sum a_i = 1$, that prove
# it:
#
# $$\max_{|\vec{L}| \le 1} \min_i -\langle \vec{N}_i, \vec{L} \rangle
#   \;=\; \min_a \Big| \sum_i a_i \vec{N}_i \Big|.$$

# %%
best = max_margin_direction(np.eye(3))
print(
    f"light along {np.round(best.light, 4)}: largest incidence "
    f"{np.degrees(best.max_incidence):.3f} degrees, "
    f"none below {np.degrees(np.arccos(best.bound)):.3f} by the multipliers"
)

# %% [markdown]
# ## The same, planned
#
# The planner knows nothing of boxes. It offers hundreds of poses, asks rays which
# samples of the surface each of them lights, and solves a set cover over these. `sweep`
# plans with every value of a setting of the rig file; cameras aren't the topic here, so
# hardly anything is asked of them. `projectors_least` is the proved lower bound: where
# it equals the count, no choice of the candidates does with fewer.

# %%
cube = box((0.2, 0.2, 0.2))
rig = load_rig("default", light="parallel")
asked = {
    "max_projectors": 8,
    "target": "surface",
    "dominant_coverage": 0.98,
    "coverage": 0.05,
    "region_coverage": 0.0,
    "cameras_by": "cover",
    "check": False,
}
table = sweep(
    cube, rig, {"limits.projector_max_incidence_deg": [60, 50, 40]}, asked=asked
)
table[["limits.projector_max_incidence_deg", "projectors", "projectors_least", "lit"]]

# %% [markdown]
# A plan has more to say. Two projectors stand before opposite corners; a second bound
# speaks of *every* pose in the workspace, not only of the candidates, and the curve
# shows what each further projector is worth: here nothing.

# %%
plan = plan_rig(cube, rig, **asked)
proof = plan.document.certificates.projectors
print(
    f"{proof.count} projectors; over {proof.candidates.n_candidates} candidates at "
    f"least {proof.candidates.lower_bound}, over every pose at least "
    f"{proof.continuous.lower_bound} ({proof.continuous.status})"
)
to_lights = np.array([-p.world_from_device[:3, 2] for p in plan.projectors])
print(np.round(to_lights, 3))
plan.plot("marginal").figure.tight_layout()

# %%
plan.draw()

# %% [markdown]
# ## Where nobody knows
#
# A ring of 60 mm: its walls keep the light out of its own inside, and no formula counts
# shadows. Rays do, and the bounds count them as well, so that the number carries its
# proof all the same. Where the object is hidden from everywhere, or the bound and the
# count part, a plan says so too.

# %%
ring = from_trimesh(trimesh.creation.annulus(r_min=50, r_max=60, height=60), unit="mm")
of_ring = plan_rig(ring, rig, **asked | {"dominant_coverage": 0.95})
needed = of_ring.document.certificates.projectors
area = of_ring.coverage.target
print(
    f"{needed.count} projectors light {area.lit_m2 / area.area_m2:.1%}; at least "
    f"{needed.candidates.lower_bound} over {needed.candidates.n_candidates} candidates,"
    f" {needed.continuous.lower_bound} over every pose ({needed.continuous.status}); "
    f"one fewer lights {needed.one_fewer.upper_bound_m2 / area.area_m2:.1%} at most"
)
of_ring.draw()

# %% [markdown]
# What a plan's words mean exactly: [semantics](../docs/reference/semantics.md); how
# candidates are made and covers are proved: [projectors](../docs/method/projectors.md),
# [covers](../docs/method/covers.md).

# %%
assert np.allclose(-best.light, 1.0 / np.sqrt(3.0), atol=1e-4)
assert abs(best.bound - best.value) < 1e-6
assert list(table["projectors"]) == [2, 3, 6]
assert list(table["projectors_least"]) == [2, 3, 6]
# Each of the two lights three faces, no face is left.
faces = to_lights @ np.hstack([np.eye(3), -np.eye(3)]) >= np.cos(np.radians(60.0))
assert (faces.sum(axis=1) == 3).all()
assert faces.any(axis=0).all()
assert proof.count == proof.continuous.lower_bound == 2
assert needed.count == needed.continuous.lower_bound == needed.candidates.lower_bound
