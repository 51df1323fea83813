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
# # Plan a face
#
# How many projectors and cameras does it take to measure a head with structured
# circular light, where do they stand, and what will they measure? This notebook plans,
# looks, and checks. It uses the sample head that ships with ringrig.

# %%
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from geometry import RayCaster, dominant_regions, principal_curvatures
from planning import RigPlan, load_mesh, load_rig, plan_rig, verify_plan
from planning.cli.other_commands import write_sample
from planning.report.drawing.face_colours import face_status, region_colours
from planning.report.drawing.figures import region_directions
from planning.report.drawing.picture_view import fitted
from planning.report.drawing.rig_picture import draw_rig
from planning.report.drawing.shader import Shader

folder = Path(tempfile.mkdtemp())
write_sample(folder / "face.obj", n_faces=12_000)
mesh = load_mesh(folder / "face.obj", unit="mm")
size = 1e3 * (mesh.bounds[1] - mesh.bounds[0])
f"{len(mesh.faces)} faces, {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm"

# %% [markdown]
# ## Look: where the surface is dominant
#
# The paper directs projectors at the regions of high curvature. libigl gives principal
# curvatures at a physical scale; the fifth of the area with the highest curvedness
# $\sqrt{(k_1^2 + k_2^2)/2}$ is cut into regions whose normals fit one cone.

# %%
regions = dominant_regions(mesh, principal_curvatures(mesh))
print(f"{len(regions)} regions, {regions.dominant_share:.1%} of the area")
points = mesh.corners.reshape(-1, 3)
shader = Shader(RayCaster(mesh), region_colours(regions.face_region))
# From the side that the regions look to.
up = np.array([0.0, 0.0, 1.0])
directions = region_directions(mesh, regions.face_region >= 0, up)
views = [fitted(points, side, up, (1000, 1200), margin_px=50) for side in directions]
Image.fromarray(np.hstack([shader.shade(view).reduce(2) for view in views]))

# %% [markdown]
# ## Plan
#
# Eq. (2) with margins decides what a projector lights; what a pair of projector and
# camera measures with rings follows from the ring's normal $m$ and the viewing ray
# $r$ (blind where $r \cdot m = 0$). Both counts are minimised over hundreds of
# candidate poses, with a proved lower bound.

# %%
plan = plan_rig(mesh, load_rig("default"), max_projectors=3, seed=0)
for kind in ("projectors", "cameras"):
    proof = getattr(plan.document.certificates, kind)
    print(
        f"{proof.count} {kind}; at least {proof.candidates.lower_bound} are "
        f"needed over {proof.candidates.n_candidates} candidates "
        f"and {proof.n_samples} samples ({proof.status})"
    )
print({key: f"{1e4 * value:.1f} cm²" for key, value in plan.coverage.target})

# %%
draw_rig(plan, face_status=face_status(plan))

# %% [markdown]
# ## Check
#
# `plan_rig` has already rendered what the cameras would see, decoded the rings and
# triangulated them, by code that shares nothing with the planner:

# %%
check = plan.document.reconstruction
print(
    f"rms {1e3 * check.accuracy_rms_m:.3f} mm, 95 % within "
    f"{1e3 * check.accuracy_p95_m:.3f} mm, {check.predicted_missing:.2%} of what was "
    f"promised is missing"
)

# %% [markdown]
# A plan is two files. Whoever receives them can recompute every claim:

# %%
plan.save(folder / "plan.json")
found = verify_plan(RigPlan.load(folder / "plan.json"), mesh)
print(found.summary())
assert found.passed
