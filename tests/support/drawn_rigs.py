"""Tables of rig files, drawn at random: each as the documents allow it."""

import copy
from random import Random
from typing import Any

from support.group_rigs import DEVICES, HEAD

Tables = dict[str, Any]

_CAMERA: Tables = {
    **{"name": "half the pixels", "resolution_px": [1024, 768], "pixel_um": 6.9},
    **{"focal_mm": 12.0, "range_mm": [300.0, 3000.0]},
}


def draw_rig(random: Random, kind: str) -> Tables:
    """Return the tables of a rig for a job of a kind."""
    if kind in ("head", "turntable"):
        tables = _carried(random, kind)
    else:
        tables = {"base": "default", "name": "drawn", "camera": _camera(random)}
        tables["placement"] = _placement(random)
        if kind == "parallel":
            tables["light"] = "parallel"
        if random.random() < 0.4:
            _draw_devices(random, tables, kind)
    tables["limits"] = tables.get("limits", {}) | _limits(random)
    tables["requirements"] = _requirements(random)
    if random.random() < 0.4:
        tables["workspace"] = _workspace(random)
    if random.random() < 0.2:
        tables["obstacle"] = [_obstacle(random)]
    single = kind not in ("head", "turntable", "none", "family")
    if random.random() < (0.2 if single else 0.02):
        tables["existing"] = [_existing(random, k) for k in range(random.randint(1, 2))]
    if kind in ("rings", "parallel", "family") and random.random() < 0.3:
        tables["rings"] = _rings(random)
    if random.random() < 0.2:
        origin = random.choice(["dot-sheet", "checkerboard"])
        tables["calibration"] = {"from": origin}
    elif random.random() < 0.3:
        tables["calibration"] = {"angle_deg": 0.0, "position_mm": 0.0}
    if random.random() < 0.15:
        tables["mounting"] = {"position_mm": 1.0, "angle_deg": 0.1}
    if kind == "dense" and random.random() < 0.4:
        tables["dense"] = {"shifts": random.choice([0, 3, 5]), "period_px": 32}
    return tables


def _carried(random: Random, kind: str) -> Tables:
    """A head, carried or in several copies, or a turntable."""
    tables = copy.deepcopy(DEVICES) | {"name": "carried"}
    table = {
        **{"point_mm": [0.0, 0.0, 0.0], "axis": random.choice([[0, 0, 1], [0, 1, 0]])},
        "steps": random.choice([4, 8, "free"]),
    }
    if kind == "turntable" or random.random() < 0.03:
        tables["turntable"] = table
    if kind == "head" or random.random() < 0.03:
        tables["head"] = HEAD | {"cross": random.random() < 0.2}
    if kind == "head" and "turntable" not in tables and random.random() < 0.4:
        carrier = random.choice(["robot", "tripod"])
        tables["stations"] = {"max": random.randint(2, 8), "carrier": carrier}
    tables["placement"] = _placement(random) | {"standoff_mm": 600.0}
    return tables


def _camera(random: Random) -> Tables:
    camera = _CAMERA | {"focal_mm": round(random.uniform(8.0, 16.0), 1)}
    if random.random() < 0.3:
        bend = random.uniform(-0.1, 0.1)
        camera["distortion"] = [round(bend, 3), 0.01, 0.0003, -0.0002, 0.0]
    if random.random() < 0.4:
        stop = random.choice([8.0, 11.0, 16.0])
        camera["focus"] = {"distance_mm": 1100.0, "f_number": stop, "blur_px": 1.0}
    return camera


def _placement(random: Random) -> Tables:
    tables: Tables = {
        "n_candidate_projectors": random.choice([16, 30, 60]),
        "n_candidate_cameras": random.choice([16, 30, 60]),
        **{"n_reference_projectors": 600, "n_reference_cameras": 400},
    }
    if random.random() < 0.3:
        tables["standoff_mm"] = random.choice([1000.0, 1050.0, 1100.0])
        tables["standoff_play_mm"] = random.choice([0.0, 20.0, 60.0])
    return tables


def _draw_devices(random: Random, tables: Tables, kind: str) -> None:
    """Lay a stock, housings, mounts or light over the devices."""
    camera, what = tables["camera"], random.choice(["stock", "body", "mount", "light"])
    if what == "stock":
        longer = _CAMERA | {"name": "longer", "focal_mm": 25.0}
        costs = [{"cost": 2.0}, {"cost": 5.0}] if random.random() < 0.4 else [{}, {}]
        models = [camera | costs[0], longer | costs[1]]
        for model in models[: random.randint(0, 2)]:
            model["count"] = random.randint(1, 3)
        tables["camera"] = models
        if costs[0] and kind != "none":
            tables[_projector(kind)] = {"cost": 3.0}
    elif what == "body":
        size = [random.uniform(40.0, 120.0) for _ in range(3)]
        camera["body"] = {"size_mm": size, "centre_mm": [0.0, 0.0, -50.0]}
        if kind != "none" and random.random() < 0.6:
            body = {"size_mm": [300.0, 120.0, 250.0], "centre_mm": [0.0, -20.0, -100.0]}
            tables[_projector(kind)] = {"body": body}
        tables["placement"]["clearance_mm"] = random.choice([0.0, 30.0])
    elif what == "mount":
        mount: Tables = {"offset_mm": [0.0, 30.0, -40.0], "axis": [0.0, 1.0, 0.0]}
        mount |= random.choice(
            [
                *({"roll_deg": [0, 90]}, {"pan_step_deg": 5.0, "tilt_step_deg": 5.0}),
                *({"grid_mm": 25.0}, {"roll_deg": [0], "tilt_step_deg": 2.5}),
            ]
        )
        camera["mount"] = mount
    else:
        stop = random.choice([8.0, 11.0])
        camera["focus"] = {"distance_mm": 1100.0, "f_number": stop, "blur_px": 1.0}
        tables["photometry"] = {
            **{"lumens": random.choice([500.0, 3000.0]), "sensor": "imx174"},
            "albedo": random.choice([0.5, [0.2, 0.7]]),
            "room_lux": random.choice([0.0, 300.0]),
        }


def _projector(kind: str) -> str:
    return "parallel_projector" if kind == "parallel" else "projector"


def _limits(random: Random) -> Tables:
    incidence = random.choice([50.0, 60.0, 65.0])
    every: Tables = {
        "camera_max_incidence_deg": random.choice([55.0, 70.0, 75.0]),
        "min_conditioning": random.choice([0.05, 0.1, 0.3]),
        "noise_px": random.choice([0.05, 0.1, 0.3]),
        "max_sigma_mm": random.choice([0.2, 0.5, 1.0, "off"]),
        "min_ring_pitch_px": random.choice([3.0, 8.0, "off"]),
        "max_sample_distance_mm": random.choice([0.5, 1.0, "off"]),
        "ring_sigma_mm": random.choice([0.05, "off"]),
        "min_angle_deg": random.choice([5.0, 15.0]),
    }
    limits = {key: value for key, value in every.items() if random.random() < 0.25}
    if random.random() < 0.4:
        limits["projector_max_incidence_deg"] = incidence
    if random.random() < 0.4:
        limits["min_tangent_angle_deg"] = random.choice([42.0, 50.0, 55.0])
    return limits


def _requirements(random: Random) -> Tables:
    every: Tables = {
        "coverage": random.choice([0.6, 0.8, 0.9]),
        "dominant_coverage": random.choice([0.6, 0.8, 0.95]),
        "min_reachable": random.choice([0.2, 0.5, 0.8]),
        "region_coverage": random.choice([0.0, 0.2, 0.7]),
        "region_share": random.choice([0.01, 0.1]),
    }
    return {key: value for key, value in every.items() if random.random() < 0.5}


def _workspace(random: Random) -> Tables:
    space: Tables = {}
    shape = random.choice(["shell", "cone", "box"])
    if shape != "shell":
        space["shape"] = shape
    if shape == "cone":
        space["axis"] = [round(random.uniform(-1.0, 1.0), 3) for _ in range(3)]
        space["half_angle_deg"] = random.choice([45.0, 80.0, 120.0])
    if shape == "box":
        space["min_mm"] = [-random.choice([800.0, 1500.0]) for _ in range(3)]
        space["max_mm"] = [random.choice([800.0, 1500.0]) for _ in range(3)]
    if random.random() < 0.4:
        space["floor_mm"] = random.choice([-600.0, -250.0, 0.0])
    if random.random() < 0.2:
        space["up"] = random.choice(["x", "y", "-z"])
    if random.random() < 0.2:
        space["origin"] = "mesh"
    if random.random() < 0.4:
        space["keep_out"] = [_keep_out(random, k) for k in range(random.randint(1, 2))]
    if random.random() < 0.25:
        away = random.choice([600.0, 900.0])
        plane = {"name": "wall", "centre_mm": [0.0, -away, 0.0], "normal": [0, 1, 0]}
        roof = {"name": "roof", "centre_mm": [0.0, 0.0, away], "normal": [0, 0, -1]}
        planes = [
            plane | {"extent_mm": [2600, 2200]},
            roof | {"extent_mm": [2400, 2400]},
        ]
        planes[0]["thickness_mm"] = random.choice([1.0, 100.0])
        space["mounting"] = planes[: random.randint(1, 2)]
    return space


def _keep_out(random: Random, k: int) -> Tables:
    way = [random.choice([-1.0, 1.0]) * random.uniform(300.0, 900.0) for _ in range(3)]
    box: Tables = {"name": f"ground {k}", "centre_mm": [round(x, 1) for x in way]}
    box["size_mm"] = [round(random.uniform(50.0, 500.0), 1) for _ in range(3)]
    if random.random() < 0.4:
        box["turn_deg"] = [0, 20, 30]
    if random.random() < 0.3:
        box["blocks"] = False
    return box


def _obstacle(random: Random) -> Tables:
    shape = random.choice(["box", "cylinder", "table"])
    thing: Tables = {"name": "thing", "shape": shape}
    if shape == "table":
        return thing | {"size_mm": [random.choice([200.0, 900.0]), 600.0, 20.0]}
    place = [random.choice([-1.0, 1.0]) * random.uniform(180.0, 500.0), 0.0, -60.0]
    random.shuffle(place)
    thing["centre_mm"] = [round(x, 1) for x in place]
    if shape == "cylinder":
        return thing | {"radius_mm": 40.0, "height_mm": 300.0, "turn_deg": [0, 30, 0]}
    return thing | {"size_mm": [120.0, 60.0, 200.0]}


def _existing(random: Random, k: int) -> Tables:
    kind = random.choice(["projector", "camera"])
    way = [random.gauss(0.0, 1.0) for _ in range(3)]
    size = random.uniform(950.0, 1150.0) / sum(x * x for x in way) ** 0.5
    place = [round(size * x, 1) for x in way]
    return {
        **{"name": f"{kind} {k}", "kind": kind, "position_mm": place},
        "aim_mm": [0.0, 0.0, 0.0],
    }


def _rings(random: Random) -> Tables:
    every: Tables = {
        "tilt_deg": random.choice([0.0, 4.0, 12.0]),
        "gap_mm": random.choice([4.0, 8.0, 15.0]),
        "axis": random.choice(["centred", "free", "auto"]),
        "margin_mm": random.choice([0.0, 40.0]),
        "spacing": random.choice(["uniform", "curvature"]),
    }
    return {key: value for key, value in every.items() if random.random() < 0.5}
