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
# # Plan, check and hand over a rig
#
# You are about to buy projectors and cameras, and to have somebody bolt them to a
# frame. What do you need to know before? How many there must be; that they will measure
# what you need, and how exactly; where each of them goes; and, once they are bolted,
# whether the rig as built still does it. This notebook goes that way for a head and the
# devices of the preset `default`.
#
# It needs `pip install 'ringrig[plot]' pandas`.

# %%
import json
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from PIL import Image

from geometry.shapes.sample_head.sample_head import sample_head
from planning import RigPlan, load_rig, plan_rig, read_mounted, verify_plan
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.mount_tables import MountTables
from planning.handover.export.write_exports import write_export

head = sample_head(n_faces=4_000, open_neck=True)
size = 1e3 * (head.bounds[1] - head.bounds[0])
print(f"{len(head.faces)} faces, {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm")

# %% [markdown]
# ## Plan
#
# The target is the fifth of the surface with the highest curvature. Both counts are
# minimised over hundreds of candidate poses: first the projectors, then, given these,
# the cameras. If a requirement is missed, `plan_rig` raises `RequirementError`, which
# carries the best plan and says what would help.

# %%
rig = load_rig("default")
plan = plan_rig(head, rig, max_projectors=3, seed=0)
for kind in ("projectors", "cameras"):
    proof = getattr(plan.document.certificates, kind)
    print(
        f"{proof.count} {kind}; at least {proof.candidates.lower_bound} over "
        f"{proof.candidates.n_candidates} candidates, {proof.continuous.lower_bound} "
        f"over every pose ({proof.continuous.status})"
    )
plan.coverage_table.round(1)

# %%
plan.draw()

# %% [markdown]
# Where they stand: millimetres in the axes of the mesh, pan, tilt and roll of the
# housing.

# %%
plan.devices.round(1)

# %% [markdown]
# ## What one device more or fewer changes, and what limits the accuracy
#
# The standard deviation $\sigma$ of a point along its normal comes from the noise of
# edges in the images, from the rings as drawn by a panel of square pixels, and from
# what a calibration leaves of each camera and projector. Where the last two are the
# longest bars, more pixels won't help, a better calibration will.

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(10.0, 3.2))
plan.plot("marginal", left)
plan.plot("sigma", right)
fig.tight_layout()

# %% [markdown]
# ## Check
#
# `plan_rig` has already checked the plan: code that shares nothing with the planner
# rendered what the cameras would see of every pattern, with noise, blur and room light,
# decoded the images, triangulated the rings and held the points against the mesh.

# %%
check = plan.document.reconstruction
print(
    f"{check.n_points} points: rms {1e3 * check.accuracy_rms_m:.3f} mm, 95 % within "
    f"{1e3 * check.accuracy_p95_m:.3f} mm; {check.predicted_missing:.2%} of what was "
    f"promised is missing"
)

# %% [markdown]
# ## Hand over
#
# A plan is `plan.json`, its surface, and proofs of its numbers. Whoever receives them
# can recompute every claim and reconstruct the object again.

# %%
folder = Path(tempfile.mkdtemp())
plan.save(folder / "plan.json")
received = RigPlan.load(folder / "plan.json")
found = received.verify(head)
print(found.summary())

# %%
distances = 1e3 * found.reconstruction.accuracy.distances
limit = 1e3 * plan.requirements.check.max_p95_m
fig, ax = plt.subplots(figsize=(7.0, 2.8))
ax.hist(distances, np.linspace(-0.15, 0.15, 121), color="C0")
ax.set(xlabel="distance of a measured point from the mesh [mm]", ylabel="points")
p95 = np.percentile(np.abs(distances), 95)
ax.set_title(f"95 % within {p95:.3f} mm, {limit:g} asked")
fig.tight_layout()

# %% [markdown]
# A claim that isn't true is found. Here somebody moved a camera by 30 mm in the file,
# and left the rest as it was:

# %%
document = json.loads((folder / "plan.json").read_text())
document["cameras"][0]["world_from_device"][2][3] += 0.030
forged = RigPlan.from_document(document, received.surface)
doubted = verify_plan(forged, head, check_pixels=False)
print(f"{len(doubted.failures)} false claims, the first:\n{doubted.failures[0]}")

# %% [markdown]
# What each projector shows is ready to be projected, frame by frame. Annuli are
# numbered by a Gray code, one bit a frame, each with its inverse:

# %%
patterns = plan.patterns(folder / "shown")
shown = sorted((patterns / "P1").glob("*.png"))[2:5]
frames = [Image.open(path).convert("L").reduce(3) for path in shown]
Image.fromarray(np.hstack(frames))

# %% [markdown]
# The builder gets tables: `mounts.csv` to measure by, with distances from four datum
# points on the floor, and `poses.csv` with all digits. (`plan export` writes eleven
# formats, for OpenCV, ROS, Blender, CAD and others, and aiming sheets.)

# %%
frame = frame_of(None, plan.requirements.workspace)
write_export(ExportedRig.of(plan, frame), MountTables(), folder / "csv")
mounts = pd.read_csv(folder / "csv" / "mounts.csv", comment="#")
mounts[["name", "point", "x_mm", "y_mm", "z_mm", *(f"to_D{k}_mm" for k in range(1, 5))]]

# %% [markdown]
# ## As built
#
# Nothing is bolted exactly where it was planned. The builder measures where the devices
# came to stand, in the columns of `poses.csv`, here up to 5 mm off in every direction,
# and ringrig evaluates that rig: rings are images, they are planned anew for where
# their projectors stand.

# %%
poses = pd.read_csv(folder / "csv" / "poses.csv", comment="#")
built = poses.copy()
off = np.random.default_rng(1).uniform(-5.0, 5.0, (len(built), 3))
built[["x_mm", "y_mm", "z_mm"]] += off
shares = {}
for name, table in {"planned": poses, "built": built}.items():
    table.to_csv(folder / f"{name}.csv", index=False)
    stands = read_mounted(folder / f"{name}.csv", rig)
    evaluated = plan_rig(
        head, rig, max_projectors=None, fixed=stands, check=False, on_miss="return"
    )
    area = evaluated.coverage.target
    shares[name] = area.measured_m2 / area.area_m2
    print(f"as {name}: {shares[name]:.1%} of the target measured, {evaluated.missed}")

# %%
counts = plan.document.certificates
assert counts.projectors.count == counts.projectors.candidates.lower_bound
assert counts.cameras.count == counts.cameras.candidates.lower_bound
assert check.passed
assert found.passed
assert p95 < limit
assert not doubted.passed
devices = (*plan.projectors, *plan.cameras)
centres = np.array([device.world_from_device[:3, 3] for device in devices])
assert np.allclose(mounts[["x_mm", "y_mm", "z_mm"]], 1e3 * centres, atol=0.01)
target = plan.coverage.target
assert abs(shares["planned"] - target.measured_m2 / target.area_m2) < 0.01
assert shares["built"] > 0.95 * shares["planned"]
