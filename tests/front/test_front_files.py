"""A front's file is read as it was written, or refused in one line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click import UsageError
from support.plain_shapes import box

from planning.cli.plans.kept_fronts import taken_point
from planning.model.errors import InputError, PlanFileError
from planning.model.progress import Stopwatch
from planning.rig.wishes import Wishes
from planning.steps.asked.request import request_of
from planning.steps.front.kept_front import FRONT_FILE, read_front
from planning.steps.front.plan_front import plan_front
from planning.steps.prepare import prepared

BLOCK = box((0.1, 0.06, 0.03))
WISHES = Wishes(max_projectors=1, max_cameras=2, target="surface")


@pytest.fixture(scope="module", autouse=True)
def _few(with_little_work):
    with with_little_work():
        yield


@pytest.fixture(scope="module")
def kept(rig):
    return plan_front(BLOCK, rig, WISHES, threads=1)


@pytest.fixture(scope="module")
def ready(rig):
    clock = Stopwatch()
    asked = request_of(BLOCK, rig, WISHES, clock, select=None, weight=None)
    return prepared(replace(asked, threads=1), clock)


@pytest.fixture(scope="module")
def folder(kept, tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    with (folder / FRONT_FILE).open("wb") as file:
        kept.write(file)
    return folder


def test_damaged_files_are_refused_in_one_line(folder, tmp_path):
    whole = (folder / FRONT_FILE).read_bytes()
    path = tmp_path / FRONT_FILE
    with pytest.raises(InputError, match="no such file; make the front again"):
        read_front(tmp_path)
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :]
    later, entry = bytearray(whole), whole.rindex(b"PK\x01\x02")
    later[entry + 6] = 143
    for broken in (b"", b"no zip", whole[:middle], flipped, bytes(later)):
        path.write_bytes(broken)
        with pytest.raises(PlanFileError, match="no front, or a damaged one") as caught:
            read_front(tmp_path)
        assert "\n" not in str(caught.value)
    np.savez(path, head=np.array('{"format": "other"}'))
    with pytest.raises(PlanFileError, match="damaged"):
        read_front(tmp_path)


@pytest.mark.parametrize("name", ["head", "stages", "point_rings"])
def test_a_file_that_was_changed_is_refused(folder, tmp_path, name):
    with np.load(folder / FRONT_FILE) as file:
        arrays = dict(file)
    changed = arrays[name].copy()
    if name == "head":
        changed = np.array(str(changed).replace('"cameras": 2', '"cameras": 1', 1))
    else:
        changed.flat[-1] += 1
    np.savez(tmp_path / FRONT_FILE, **(arrays | {name: changed}))
    with pytest.raises(PlanFileError, match="isn't what was written") as caught:
        read_front(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("version", ["2", 1, None, True])
def test_a_front_of_another_version_is_told_as_it_says(folder, tmp_path, version):
    with np.load(folder / FRONT_FILE) as file:
        arrays = dict(file)
    head = json.loads(str(arrays["head"])) | {"version": version}
    np.savez(tmp_path / FRONT_FILE, **(arrays | {"head": np.array(json.dumps(head))}))
    told = f"of version {version!r}, and 'ringrig-front' of version 2 is read"
    with pytest.raises(PlanFileError, match=told):
        read_front(tmp_path)


def point_changed(front, **values):
    return front.changed(points=(front.points[0].changed(**values), *front.points[1:]))


@pytest.mark.parametrize(
    "change",
    [
        {"projector_poses": lambda a: a[1:]},
        {"camera_poses": lambda a: np.full_like(a, np.nan)},
        {"camera_models": lambda a: a - 1},
        {"point_rings": lambda a: a[:1]},
        {"stages": lambda a: a.astype(float)},
        {"seen": lambda a: a[:10]},
        {"lights": (99999,)},
        {"lights": ()},
        {"views": (1, 2)},
        {"cameras": 7},
    ],
)
def test_parts_that_dont_fit_together_are_refused(kept, tmp_path, change):
    """Whatever wrote them: their digest is right."""
    ((name, value),) = change.items()
    if name in kept.arrays:
        other = replace(kept, arrays=kept.arrays | {name: value(kept.arrays[name])})
    else:
        other = replace(kept, front=point_changed(kept.front, **change))
    with (tmp_path / FRONT_FILE).open("wb") as file:
        other.write(file)
    with pytest.raises(PlanFileError, match="don't fit together") as caught:
        read_front(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("none", [{"points": ()}, {"area_m2": 0.0}])
def test_a_front_of_nothing_is_refused(kept, tmp_path, none):
    empty = kept.front.model_copy(update=none)
    with (tmp_path / FRONT_FILE).open("wb") as file:
        replace(kept, front=empty).write(file)
    with pytest.raises(PlanFileError, match=r"damaged one \(a field\)"):
        read_front(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"stages": lambda a: a[8:], "seen": lambda a: a[1:]},
        {"stages": lambda a: np.hstack([a, a])},
        {"seen": lambda a: np.hstack([a, a])},
        {"camera_models": lambda a: a + 5},
        {"projector_models": lambda a: a + 5},
    ],
)
def test_arrays_of_another_mesh_or_rig_are_refused(kept, ready, change):
    others = {name: value(kept.arrays[name]) for name, value in change.items()}
    with pytest.raises(PlanFileError, match="don't fit the mesh and rig"):
        replace(kept, arrays=kept.arrays | others).matrix(ready)


def test_more_devices_are_advised_beyond_a_front_alone(kept, folder, tmp_path):
    with pytest.raises(UsageError, match=r"--max-projectors 2 --max-cameras 2$"):
        taken_point((2, 1), folder)
    # A projector and two cameras stand: columns without a pose, and no smaller point.
    columns = {"stages": 1, "seen": 2}
    more = {k: np.pad(kept.arrays[k], ((0, 0), (n, 0))) for k, n in columns.items()}
    front = kept.front.changed(points=kept.front.points[1:])
    arrays = kept.arrays | more | {"point_rings": kept.arrays["point_rings"][1:]}
    with (tmp_path / FRONT_FILE).open("wb") as file:
        replace(kept, front=front, arrays=arrays).write(file)
    said = "take one of these: 1 projector and 2 cameras stand already, and are in each"
    with pytest.raises(UsageError, match=f"{said}$"):
        taken_point((1, 1), tmp_path)
