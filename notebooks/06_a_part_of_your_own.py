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
# # A part of your own: from a photo of the bench to a rig file
#
# You have a part, a bench with things on it that can't be moved, some projectors and
# cameras, and a phone. What ringrig needs is a mesh and a rig file: which devices, how
# far away, and what stands in the way. This notebook takes the sizes from a photo,
# writes the file, plans with it, and makes sure that nothing is bolted into the vise.
#
# It needs `pip install 'ringrig[plot]' pandas`.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from geometry import RayCaster, TriangleMesh, from_trimesh
from geometry.poses import look_at, transform
from planning import load_rig, plan_rig
from planning.rig.toml.new_rig import Answers, new_rig

# %% [markdown]
# ## The part
#
# A flanged hub, 100 mm across and 40 mm high. Yours comes from a file:
# `load_mesh("part.stl", unit="mm")`. Its axes are those in which everything below is
# counted: the origin is in the middle of the face that it stands on, z is up.

# %%
profile = [(12, 0), (50, 0), (50, 12), (28, 12), (22, 40), (12, 40), (12, 0)]
hub = from_trimesh(trimesh.creation.revolve(profile, sections=64), unit="mm")
print(f"{len(hub.faces)} faces, {1e3 * (hub.bounds[1] - hub.bounds[0])} mm")

# %% [markdown]
# ## The photo
#
# Put the part on a sheet of A4, in its middle, and photograph the bench from as far as
# it takes to have everything in the picture, with zoom and crop off. The repository
# ships no photo, so one is rendered: a pinhole of 1280 x 960 px with $f = 1150$ px, the
# bench, the sheet, a vise and a post. Only the picture and $f$ (from its EXIF data, or
# a calibration) are used later; what is drawn here is held against what was read off.

# %%
F_PX, WIDTH, HEIGHT = 1150.0, 1280, 960
DRAWN = {  # middle of the base and size, mm
    "vise": ((-225.0, 60.0), (110.0, 150.0, 120.0)),
    "post": ((190.0, 215.0), (45.0, 45.0, 330.0)),
}


def block(size, centre):
    move = trimesh.transformations.translation_matrix(centre)
    return trimesh.creation.box(size, move)


bodies = [block((900, 700, 20), (0, 60, -10)), block((297, 210, 0.5), (0, 0, 0.25))]
bodies += [block(s, (*at, 0.5 * s[2])) for at, s in DRAWN.values()]
bodies += [trimesh.creation.revolve(profile, sections=64)]
colours = np.array(
    [[150, 120, 90], [245, 245, 245], [70, 95, 140], [120, 120, 125], [190, 150, 80]]
)
whole = trimesh.util.concatenate(bodies)
scene = TriangleMesh(1e-3 * np.array(whole.vertices), np.array(whole.faces))
of_face = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])

phone = look_at(
    np.array([0.33, -0.85, 0.75]), np.array([-0.01, 0.06, 0.05]), np.eye(3)[2]
)
px = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1).reshape(-1, 2)
rays = (px - [0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)]) / F_PX
rays = np.column_stack([rays, np.ones(len(rays))]) @ phone[:3, :3].T
rays /= np.linalg.norm(rays, axis=1, keepdims=True)
caster = RayCaster(scene)
face, _ = caster.first_hits(phone[:3, 3], rays)
lamp = np.array([-0.4, -0.5, 0.77])
bright = 0.35 + 0.65 * np.clip(scene.face_normals @ lamp, 0.0, 1.0)
shaded = colours[of_face] * bright[:, None]
photo = np.where(face[:, None] < 0, 225.0, shaded[face]).reshape(HEIGHT, WIDTH, 3)
photo = photo.astype(np.uint8)
fig, ax = plt.subplots(figsize=(8.0, 6.0))
ax.imshow(photo)
ax.set(xlabel="u [px]", ylabel="v [px]")
fig.tight_layout()

# %% [markdown]
# ## Sizes from the photo
#
# Point at corners, in any viewer that shows pixels: those of the sheet, anticlockwise
# from its left front, and for each thing the corners of its base that can be seen, and
# one of its top. The numbers below were read off an enlarged copy of the picture above,
# to a pixel.

# %%
SHEET_MM = np.array(
    [(-148.5, -105.0), (148.5, -105.0), (148.5, 105.0), (-148.5, 105.0)]
)
SHEET_PX = np.array([(450, 582), (738, 657), (794, 524), (538, 469)])
READ = {  # base: left front, right front, right back; which of these the top is over
    "vise": ([(382, 504), (472, 525), (533, 451)], 1, (463, 430)),
    "post": ([(832, 483), (871, 491)], 0, (865, 201)),  # square, so two will do
}

# %% [markdown]
# The sheet's plane and the image are tied by a homography $H$: with the sheet's axes as
# those of the world, eq. (3) says for points with $z = 0$
#
# $$\begin{pmatrix} u \\ v \\ 1 \end{pmatrix} \sim
#   M_{in} M_{ex} \begin{pmatrix} x \\ y \\ 0 \\ 1 \end{pmatrix}
#   = \underbrace{M_{in} (r_1\; r_2\; t)}_{H}
#   \begin{pmatrix} x \\ y \\ 1 \end{pmatrix}.$$
#
# Four corners give $H$ up to a factor; $M_{in}^{-1} H$ has unit columns $r_1$ and
# $r_2$, which gives the factor, $r_3 = r_1 \times r_2$, and with it the whole $M$.
# Places on the bench follow from $H^{-1}$, the height over such a place from $M$.

# %%
ones = np.ones((4, 1))
rows = []
for (x, y), (u, v) in zip(SHEET_MM, SHEET_PX, strict=True):
    rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y, -u])
    rows.append([0, 0, 0, x, y, 1, -v * x, -v * y, -v])
H = np.linalg.svd(np.array(rows, dtype=float))[2][-1].reshape(3, 3)
M_in = np.array(
    [[F_PX, 0, 0.5 * (WIDTH - 1)], [0, F_PX, 0.5 * (HEIGHT - 1)], [0, 0, 1]]
)
columns = np.linalg.solve(M_in, H)
columns /= np.sign(columns[2, 2]) * np.linalg.norm(columns[:, :2], axis=0).mean()
r1, r2, shift = columns.T
r3 = np.cross(r1, r2)
M = M_in @ np.column_stack([r1, r2, r3, shift])


def on_bench(pixel):
    """Where on the bench a pixel is, in mm."""
    x, y, w = np.linalg.solve(H, [*pixel, 1.0])
    return np.array([x, y]) / w


def height(base, pixel):
    """How high over a place the top is that a pixel shows, in mm."""
    start = M @ [*base, 0.0, 1.0]
    across = np.cross([*pixel, 1.0], M[:, 2])
    return -(across @ np.cross([*pixel, 1.0], start)) / (across @ across)


def measured(base, over, top):
    """Middle of the base, size, and turn about z, of a box in mm and degrees."""
    corners = [on_bench(pixel) for pixel in base]
    front = corners[1] - corners[0]
    along, width = front / np.linalg.norm(front), np.linalg.norm(front)
    depth = width if len(corners) == 2 else np.linalg.norm(corners[2] - corners[1])
    middle = corners[0] + 0.5 * front + 0.5 * depth * np.array([-along[1], along[0]])
    turn = np.degrees(np.arctan2(along[1], along[0]))
    return middle, np.array([width, depth, height(corners[over], top)]), turn


things = {name: measured(*read) for name, read in READ.items()}
phone_mm = -np.column_stack([r1, r2, r3]).T @ shift
print(f"the phone was at {np.round(phone_mm)} mm, drawn at {1e3 * phone[:3, 3]}")
for name, (middle, extent, turn) in things.items():
    at, drawn = DRAWN[name]
    print(
        f"{name}: {np.round(extent)} mm at {np.round(middle)}, "
        f"turned {turn:.1f} degrees"
    )
    print(f"      drawn: {drawn} at {at}")

# %% [markdown]
# ## The rig file
#
# `plan rigs new` writes one from a few answers; here by the function behind it. What
# you know of your devices: the projector's throw ratio (distance over image width) and
# pixels, the camera's pixels and their size, and how far away they may stand. What you
# don't answer is chosen and said.

# %%
answers = Answers(
    object_mm=110.0,
    throw_ratio=1.2,
    projector_px=(1280, 800),
    sensor_px=(1440, 1080),
    pixel_um=3.45,
    distance_mm=500.0,
    name="my bench",
)
written, chosen = new_rig(answers)
print("\n".join(chosen))

# %% [markdown]
# The rest is yours to add. `[workspace]` says where devices may stand: `origin =
# "mesh"` counts all places from the part's own origin, the room ends at the wall behind
# the bench, and no device comes lower than 40 mm over it. Each thing on the bench
# becomes an `[[obstacle]]`: light and views end at it, and no housing
# (`[projector.body]`, `[camera.body]`) touches it. A photo is good to some millimetres,
# so each is made 15 mm larger all round. With `[camera.mount]` the plan says where the
# camera's thread goes. [Every key](../docs/reference/rig-files.md).

# %%
MARGIN_MM = 15.0
tables = [
    """
[projector.body]
size_mm = [180, 90, 160]
centre_mm = [0, 0, -70]

[camera.body]
size_mm = [50, 50, 110]
centre_mm = [0, 0, -35]

[camera.mount]
offset_mm = [0, 25, -40]
axis = [0, 1, 0]

[workspace]
origin = "mesh"
shape = "box"
min_mm = [-900, -900, 40]
max_mm = [900, 450, 900]

[[obstacle]]
name = "bench"
shape = "table"
size_mm = [900, 700, 20]
centre_mm = [0, 60, 0]
"""
]
for name, (middle, extent, turn) in things.items():
    width, depth, tall = extent + [2 * MARGIN_MM, 2 * MARGIN_MM, MARGIN_MM]
    tables.append(
        f"""
[[obstacle]]
name = "{name}"
shape = "box"
centre_mm = [{middle[0]:.0f}, {middle[1]:.0f}, {0.5 * tall:.0f}]
size_mm = [{width:.0f}, {depth:.0f}, {tall:.0f}]
turn_deg = [0, 0, {turn:.1f}]
"""
    )
folder = Path(tempfile.mkdtemp())
(folder / "bench.toml").write_text(written + "".join(tables), encoding="utf-8")
print("".join(tables[1:]))

# %% [markdown]
# ## Plan
#
# `select` takes the faces that matter, by any rule that NumPy can say: here all but
# those that the part stands on, and the bore.

# %%
rig = load_rig(folder / "bench.toml")
middles = hub.corners.mean(axis=1)
wanted = (hub.face_normals[:, 2] > -0.5) & (np.hypot(*middles.T[:2]) > 0.0125)
plan = plan_rig(hub, rig, max_projectors=4, select=wanted)
for kind in ("projectors", "cameras"):
    proof = getattr(plan.document.certificates, kind)
    print(
        f"{proof.count} {kind}, at least {proof.candidates.lower_bound} over "
        f"{proof.candidates.n_candidates} candidates"
    )
check = plan.document.reconstruction
print(
    f"{check.n_points} points: rms {1e3 * check.accuracy_rms_m:.3f} mm, "
    f"{check.predicted_missing:.2%} of what was promised is missing"
)
plan.devices.round(1)

# %%
plan.draw()

# %% [markdown]
# ## Back into the photo
#
# $M$ of eq. (3) takes the plan into the picture that it began with: where the optical
# centres will be, with a plumb line down to the level of the bench. Show this to who
# has to bolt them.

# %%
devices = (*plan.projectors, *plan.cameras)
fig, ax = plt.subplots(figsize=(8.0, 6.0))
ax.imshow(photo)
for device in devices:
    centre = 1e3 * device.world_from_device[:3, 3]
    line = np.array([centre, [centre[0], centre[1], 0.0], [0.0, 0.0, 20.0]])
    u, v, w = M @ np.column_stack([line, np.ones(3)]).T
    top, foot, part = np.column_stack([u / w, v / w])
    colour = "C1" if device in plan.projectors else "C0"
    ax.plot(*zip(top, foot, strict=True), ":", color=colour)
    ax.plot(*zip(top, part, strict=True), color=colour, lw=0.8)
    ax.plot(*top, "o", color=colour)
    paper = {"fc": "white", "ec": "none", "pad": 1.0}
    ax.annotate(
        device.id, top, (7, 7), textcoords="offset points", color=colour, bbox=paper
    )
ax.set(xlim=(0, WIDTH - 1), ylim=(HEIGHT - 1, -40))
ax.set_axis_off()
fig.tight_layout()

# %% [markdown]
# ## Nothing in the vise
#
# The planner says so, the audit of `plan.verify` too. Here it is once more, by hand: no
# corner of a housing is inside a thing as it really stands, that is as it was drawn and
# not as it was measured; all are over the bench and before the wall.

# %%
signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3)


def inside(points, middle, extent, turn=0.0):
    """Which points are in a box that stands on the bench, in mm and degrees."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    local = (points[:, :2] - middle) @ np.array([[c, -s], [s, c]])
    flat = (np.abs(local) <= 0.5 * np.asarray(extent[:2])).all(axis=1)
    return flat & (points[:, 2] >= 0.0) & (points[:, 2] <= extent[2])


apart = {}
for device in devices:
    centre, half = np.array(device.body.centre_m), np.array(device.body.half_m)
    corners = transform(device.world_from_device, centre + 2.0 * half * signs)
    # Points all over the housing, and its optical centre.
    grid = np.vstack(
        [t * corners + (1 - t) * corners.mean(axis=0) for t in (0, 0.5, 1)]
    )
    apart[device.id] = 1e3 * np.vstack([grid, device.world_from_device[:3, 3]])

for name, ((x, y), extent) in DRAWN.items():
    middle, read, turn = things[name]
    grown = read + [2 * MARGIN_MM, 2 * MARGIN_MM, MARGIN_MM]
    drawn = signs * extent + [x, y, 0.5 * extent[2]]
    assert inside(drawn, middle, grown, turn).all(), f"{name} is larger than measured"
    assert np.allclose(read, extent, atol=MARGIN_MM)
    for points in apart.values():
        assert not inside(points, (x, y), extent).any()
for points in apart.values():
    assert points[:, 2].min() > 0.0
    assert points[:, 1].max() <= 450.01
assert not plan.missed
assert check.passed
proved = plan.document.certificates.projectors.candidates
assert proved.lower_bound == len(plan.projectors)
