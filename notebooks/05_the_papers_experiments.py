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
# # The paper's box
#
# Section VII of Lee & Krim: a box under 2 projectors of 7 circles each, 2 cameras on
# its left and right, everything about 1 m away. The authors had no ground truth; here
# images are rendered, so that every measured point can be held against the box.
#
# The paper gives resolutions, distances, the number of circles, and what a calibration
# gave: f = 8000 px, image centre (174, 68). Everything else is ours: a box of 120 mm
# with an edge towards the rig, circles 12 mm apart, and where devices stand
# (`planning/experiments/setups.py`).

# %%
import textwrap

import numpy as np

from planning import RequirementError, load_rig, plan_rig
from planning.experiments.paper_figures import (
    draw_camera_images,
    draw_densities,
    draw_errors,
    draw_redundancy,
    draw_viewpoints,
)
from planning.experiments.point_panels import PanelStage
from planning.experiments.run import double_density, run_experiment
from planning.experiments.setups import box_experiment
from planning.experiments.table import cloud_lines, ring_lines, setup_lines
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.rig_picture import draw_rig

printed = box_experiment()
print("\n".join(setup_lines(printed)))

# %% [markdown]
# ## What the cameras see (Fig. 5)
#
# With 8000 px a camera sees 160 x 90 mm at 1 m: less than the box. The image centre,
# far from the middle of the image, says that it is a crop or that the calibration was
# weak. Where rings of both projectors cross, their light adds up (Fig. 3).

# %%
as_printed = run_experiment(printed)
draw_camera_images(as_printed)

# %% [markdown]
# A lens of 2800 px with its centre in the middle sees the whole box:

# %%
outcome = run_experiment(box_experiment(variant="fits"))
draw_camera_images(outcome)

# %% [markdown]
# ## From each viewpoint
#
# Rings are told apart by a coded sequence: 8 annuli, 3 bits and their inverses, white,
# black, and a disc with its inverse that tells the two roots of each ray apart. On the
# left what one projector and one camera measure, then each camera under both.

# %%
stage = PanelStage(outcome.experiment.mesh)
draw_viewpoints(outcome, stage)

# %% [markdown]
# Eq. (3), $M = M_{in} M_{ex}$, takes points to pixels. It has no inverse: every point
# of a ray has the same image, and only the ring's equation says how far away it is.

# %%
cloud = outcome.union.cloud
camera = outcome.experiment.scanner.cameras[0]
own = cloud.take(cloud.camera == 0)
turn = camera.world_from_device[:3, :3].T
matrix = camera.matrix @ np.column_stack([turn, -turn @ camera.centre])
print(np.round(matrix, 3))
u, v, w = matrix @ np.column_stack([own.points, np.ones(len(own))]).T
print(f"{np.abs(np.column_stack([u / w, v / w]) - own.pixels).max():.1e} px")

# %% [markdown]
# ## Redundancy removed, merged (Figs. 8 to 10)
#
# Eq. (6) should read $Y_2 = J y_2$: points in the frame of the second projector come
# into that of the first. Poses are known here, so $J$ is, and all clouds are in one
# frame. $Y = Y_1 + Y_2 - (Y_1 \cap Y_2)$, eq. (7): where clouds overlap is found from
# the light in the images and confirmed by geometry. What several cameras measured of a
# ring is one curve; a point at a step that nothing confirms goes.

# %%
first, second = outcome.experiment.scanner.projectors
print(np.round(np.linalg.inv(first.world_from_ring) @ second.world_from_ring, 4))
draw_redundancy(outcome, stage)

# %% [markdown]
# ## The error that the authors could not give
#
# In mm; `half gap` and `one gap` are the shares of what is lit and seen that have a
# point within half a ring gap, and one.

# %%
print("\n".join(cloud_lines(outcome.clouds)))
print()
print("\n".join(cloud_lines(as_printed.clouds)))
draw_errors(outcome, stage)

# %% [markdown]
# What becomes of each ring: the share of its circumference that lands on the box, and
# of it what each camera sees and measures.

# %%
print("\n".join(ring_lines(outcome)))

# %% [markdown]
# ## A second sequence
#
# The paper's future work asks for the sampling density "given the density of previous
# light sources". Rings can't come nearer to each other than images resolve; a second
# sequence doubles the density all the same. Its rings go where the first one's points
# bend most between its rings.

# %%
both = double_density(outcome)
print("\n".join(cloud_lines((outcome.union, both))))
draw_densities(outcome.union, both, stage)

# %% [markdown]
# ## Planned, not placed
#
# `lee-krim-2014` is the paper's rig as a preset, each figure marked as read, derived or
# assumed (`plan rigs show lee-krim-2014`); `lee-krim-2014-fits` has the lens of 2800
# px. Placed by hand, the devices above
# light and see a third of the box from one side. Planned, two projectors stand before
# opposite corners and light all six faces, no device is wasted on an overlap. With
# 8000 px two cameras are too few, and the planner says so; with the lens that fits two
# measure nearly all: a wedge lies on each camera's blind curve, $r \cdot m = 0$, and
# between few circles some places are more than a ring gap from any point.

# %%
plans = {}
for name in ("lee-krim-2014", "lee-krim-2014-fits"):
    try:
        plan = plan_rig(printed.mesh, load_rig(name), max_projectors=2, max_cameras=2)
        missed = ()
    except RequirementError as error:
        plan, missed = error.plan, error.shortfalls
    area = plan.coverage.target
    print(
        f"{name}: lit {area.lit_m2 / area.area_m2:.1%} of the target, measured "
        f"{area.measured_m2 / area.area_m2:.1%}, of the whole surface "
        f"{plan.coverage.surface.measured_m2 / plan.coverage.surface.area_m2:.1%}"
    )
    for line in missed:
        print(textwrap.fill(line, 96, initial_indent="  - ", subsequent_indent="    "))
    plans[name] = plan

# %%
draw_rig(plan, face_status=face_status(plan))

# %%
assert outcome.union.errors.rms_m < 0.03e-3
assert outcome.merged.complete[1] > 0.98
assert both.complete[0] > outcome.union.complete[0] + 0.05
fits = plans["lee-krim-2014-fits"].coverage.surface
assert fits.measured_m2 > 0.9 * fits.area_m2
assert plans["lee-krim-2014"].coverage.surface.measured_m2 < 0.8 * fits.area_m2
