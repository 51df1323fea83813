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
# # The paper's experiments
#
# Section VII of Lee & Krim (2014) shows a box and a face under structured circular
# light, measured by 2 projectors and 2 cameras about 1 m away, and ends: "Since the
# experiments are conducted using real objects, the ground truth models are not
# provided, the reconstruction results cannot be compared to the original object." Here
# both are simulated from rendered pixels, so that every measured point can be held
# against the object.
#
# The paper gives resolutions, distances, the number of circles, and what a calibration
# gave: $f = 8000$ px, image centre $(174, 68)$. Everything else is ours: a box of 120
# mm with an edge towards the rig, circles 12 mm apart, the sample head, and where
# devices stand ([in full](../docs/use/experiments.md)).

# %%
import textwrap

import numpy as np

from planning import load_rig, plan_rig
from planning.experiments.paper_figures import (
    draw_camera_images,
    draw_errors,
    draw_redundancy,
    draw_viewpoints,
)
from planning.experiments.point_panels import PanelStage
from planning.experiments.run import double_density, run_experiment
from planning.experiments.setups import box_experiment, face_experiment
from planning.experiments.table import cloud_lines, label_line, ring_lines, setup_lines

printed = box_experiment()
print("\n".join(setup_lines(printed)))

# %% [markdown]
# ## The box: what the cameras see (Fig. 5)
#
# With 8000 px a camera sees 160 x 90 mm at 1 m: less than the box. The image centre,
# far from the middle of the image, says that it is a crop or that the calibration was
# weak. Where rings of both projectors cross, their light adds up (Fig. 3).

# %%
as_printed = run_experiment(printed)
draw_camera_images(as_printed)

# %% [markdown]
# A lens of 2800 px with its centre in the middle sees the whole box. All that follows
# is with that one.

# %%
outcome = run_experiment(box_experiment(variant="fits"))
draw_camera_images(outcome)

# %% [markdown]
# ## From pixels to points: equations (3) and (4)
#
# $$y_j = M^j x_j, \qquad M^j = M_{in}^j M_{ex}^j \tag{3}$$
#
# takes points to pixels. It has no inverse: every point of a ray has the same image,
# and only the ring says how far away it is. For a camera on the projector's own axis
# that is
#
# $$z = \frac{f R}{\sqrt{u^2 + v^2}}, \tag{4}$$
#
# for any other the ray is cut with the ring's surface. Which ring it is, a coded
# sequence tells: 8 annuli, 3 bits and their inverses, white, black, and a disc with its
# inverse that tells the two roots of each ray apart. On the left what one projector and
# one camera measure, then each camera under both (Fig. 7).

# %%
cloud = outcome.union.cloud
camera = outcome.experiment.scanner.cameras[0]
own = cloud.take(cloud.camera == 0)
turn = camera.world_from_device[:3, :3].T
M = camera.matrix @ np.column_stack([turn, -turn @ camera.centre])
u, v, w = M @ np.column_stack([own.points, np.ones(len(own))]).T
back = np.abs(np.column_stack([u / w, v / w]) - own.pixels).max()
print(np.round(M, 3))
print(f"{len(own)} points come back to their pixels within {back:.1e} px")

# %%
stage = PanelStage(outcome.experiment.mesh)
draw_viewpoints(outcome, stage)

# %% [markdown]
# ## Redundancy removed, merged: equations (5) to (7), Figs. 8 to 10
#
# $$y_1 = M^1 x_1, \quad y_2 = M^2 x_2 \tag{5}$$
# $$Y_1 = y_1, \quad Y_2 = \mathfrak{I} y_1 \tag{6}$$
# $$Y = Y_1 \cup Y_2 = Y_1 + Y_2 - (Y_1 \cap Y_2) \tag{7}$$
#
# (6) should read $Y_2 = \mathfrak{I} y_2$: points in the frame of the second projector
# come into that of the first. Poses are known here, so $\mathfrak{I}$ is, and all
# clouds are in one frame. Where they overlap is found from the light in the images and
# confirmed by geometry. What several cameras measured of a ring is one curve; a point
# at a step that nothing confirms goes.

# %%
first, second = outcome.experiment.scanner.projectors
print(np.round(np.linalg.inv(first.world_from_ring) @ second.world_from_ring, 4))
draw_redundancy(outcome, stage)

# %% [markdown]
# ## The error that the authors could not give
#
# In mm; `half gap` and `one gap` are the shares of what is lit and seen that have a
# point within half a ring gap, and one. The last row is the paper's future work,
# "sampling density determination given the density of previous light sources": rings
# can't come nearer to each other than images resolve, but a second sequence, whose
# rings go where the first one's points bend most, doubles the density.

# %%
both = double_density(outcome)
print("\n".join(cloud_lines((*outcome.clouds, both))))
draw_errors(outcome, stage)

# %% [markdown]
# ## The face (Fig. 6)
#
# "Our experiment used 3 circular patterns whose radii are 1, 2, and 4 inch
# respectively, and the object is illuminated, with the deformed patterns, is viewed
# from 2 different positions." With $f = 8000$ px the image holds 160 x 90 mm. The ring
# of 2 inches is 102 mm across, that of 4 inches 203 mm: they don't fit. `landed` is the
# share of a ring's circumference that falls on the head at all, `seen` what of it is in
# a camera's image.

# %%
face_as_printed = run_experiment(face_experiment())
print("\n".join(setup_lines(face_as_printed.experiment)))
print()
print("\n".join(ring_lines(face_as_printed)))
draw_camera_images(face_as_printed)

# %% [markdown]
# With 2800 px the images hold the rings. Nearly half of the ring of 4 inches is missing
# all the same: it is wider than the head and passes it by, what the paper calls a false
# projection. The ring of 2 inches is measured to 0.025 mm. The ring of 1 inch passes
# below the nose, where the tip hides the lip: beyond a step of depth the next annulus
# is often the next number, too, and with 4 annuli nothing tells such a false edge from
# a ring.

# %%
face = run_experiment(face_experiment(variant="fits"))
print("\n".join(ring_lines(face)))
print()
print("\n".join(cloud_lines(face.clouds)))
draw_errors(face, PanelStage(face.experiment.mesh))

# %% [markdown]
# ## A single image
#
# One image of bright circles, as the paper shows it, has no labels. If the object is
# known to lie within 6 mm of a mesh, here the head moved back by 5 mm, a ray meets at
# most one of 3 rings near it: that ring is meant. Where several do, the point is left
# out.

# %%
shot = run_experiment(face.experiment, tolerance_m=6e-3)
print(label_line(shot.labels))
print("\n".join(cloud_lines(shot.clouds)))

# %% [markdown]
# ## Planned, not placed
#
# `lee-krim-2014-fits` is the paper's rig with the lens of 2800 px as a preset, each
# figure marked as read, derived or assumed (`plan rigs show lee-krim-2014-fits
# --sources`). Placed by hand, the devices above light and see a third of the box from
# one side. Planned, two projectors stand before opposite corners and light all six
# faces, no device is wasted on an overlap, and two cameras measure nearly all: a wedge
# lies on each camera's blind curve, $r \cdot m = 0$. What the check from pixels misses
# is said first: between so few circles some places are more than a ring gap from any
# point.

# %%
planned = plan_rig(
    printed.mesh,
    load_rig("lee-krim-2014-fits"),
    max_projectors=2,
    max_cameras=2,
    on_miss="return",
)
print(textwrap.fill(" ".join(planned.missed), 96))
surface = planned.coverage.surface
shares = {
    "placed by hand": outcome.visible,
    "planned": surface.measured_m2 / surface.area_m2,
}
print({name: f"{share:.1%} of the surface" for name, share in shares.items()})
planned.draw()

# %%
assert back < 1e-6
assert outcome.union.errors.rms_m < 0.03e-3
assert outcome.merged.errors.rms_m < outcome.union.errors.rms_m
assert outcome.merged.complete[1] > 0.98
assert both.complete[0] > outcome.union.complete[0] + 0.05
assert all(ring.on_object < 0.6 for ring in face.outcomes if ring.ring == 2)
assert face.union.errors.rest_m < 0.2e-3
assert shot.labels.wrong < 0.002 * shot.labels.n
assert shares["planned"] > 0.9 > 2.0 * shares["placed by hand"]
