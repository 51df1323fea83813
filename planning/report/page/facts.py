"""What the viewer knows beside the surface: devices, limits, zones and the sequence."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.bodies import Box
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.plan import RigPlan
from planning.report.drawing.obstacle_figures import drawn_obstacles
from planning.rings.acquisition import n_frames
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.predicates import (
    LIGHT_CAUSES,
    PAIR_CAUSES,
    SEEN,
    SIGHT_CAUSES,
)
from planning.verify.audit.predicates.view_pairs import VIEW_CAUSES

from .layers import layers
from .payload import Payload, add_mesh
from .per_face import PerFace


def viewer_facts(
    plan: RigPlan, samples: AuditSamples, facts: PerFace, error_m: Array | None
) -> tuple[dict[str, Any], Payload]:
    """Return what the viewer is told as plain JSON values, and its arrays."""
    payload, mesh = Payload(), plan.surface.mesh
    box = add_mesh(payload, "mesh", mesh.vertices, mesh.faces)
    ways = list(layers(plan, samples, facts, error_m))
    for layer in ways:
        payload.add(f"layer.{layer.about['id']}", layer.codes, delta=True)
    beyond = np.maximum(facts.pairs.reshape(-1, len(samples)) - SEEN, 0)
    for name, steps in (
        ("light", facts.light),
        ("sight", facts.sight),
        ("pairs", beyond),
    ):
        payload.add(name, steps.T.astype(np.uint8))
    payload.add("best", np.where(facts.best < 0, 65535, facts.best).astype(np.uint16))
    failing = facts.failing.reshape(-1, len(samples))
    payload.add("failing", _half_floats(failing).T)
    payload.add("steep", _directions(samples.steep))
    return {
        "mesh": box,
        "devices": [_device(device) for device in (*plan.projectors, *plan.cameras)],
        "limits": _limits(plan),
        "causes": {
            **{"light": LIGHT_CAUSES, "sight": SIGHT_CAUSES},
            "pair": VIEW_CAUSES[1:] if plan.cameras_alone else PAIR_CAUSES,
        },
        "layers": [layer.about for layer in ways],
        "sequence": _sequence(plan),
        "centre": list(plan.requirements.workspace.centre),
        "up": list(plan.requirements.workspace.up),
        "zones": _zones(plan),
        "obstacles": _obstacles(plan, payload),
        "arrays": payload.entries,
    }, payload


def as_script(values: dict[str, Any]) -> str:
    """Return JSON that ends no script element, whatever names it holds."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _device(device: PlannedProjector | PlannedCamera) -> dict[str, Any]:
    optics = device.device
    shown: dict[str, Any] = {
        "id": device.id,
        "kind": "camera",
        "existing": device.existing,
        "station": device.station,
        "pose": device.world_from_device.tolist(),
        "resolution": list(optics.resolution),
        "range": list(optics.range_m),
        "body": None if device.body is None else asdict(device.body),
    }
    if isinstance(optics, PinholeModel):
        shown |= {"K": optics.camera_matrix.tolist()}
        shown |= {"distortion": list(optics.distortion)}
    else:
        shown |= {"pitch": optics.pixel_pitch_m, "beam": optics.beam_radius}
    if isinstance(device, PlannedProjector):
        shown |= {
            "kind": "projector",
            "ring": device.world_from_ring.tolist(),
            "radii": device.ring_radii.tolist(),
        }
    return shown


def _limits(plan: RigPlan) -> dict[str, Any]:
    asked = plan.requirements
    pair, light = asked.triangulation, asked.triangulation.light
    return {
        "projector_max_incidence": asked.projector.max_incidence,
        "min_tangent_angle": asked.projector.min_tangent_angle,
        "camera_max_incidence": asked.camera.max_incidence,
        "max_sample_distance_m": asked.camera.max_sample_distance_m,
        "too_dark": None if light is None else light.min_contrast,
        "clipped": None if light is None else 254.5,
        "conditioning": pair.min_conditioning,
        "angle": list(pair.angles),
        "sigma": pair.max_sigma_m,
        "pitch": pair.min_ring_pitch_px,
        "view_angle": list(pair.angles),
        "view_sigma": pair.max_sigma_m,
    }


def _sequence(plan: RigPlan) -> list[dict[str, Any]]:
    """Which projectors shine in each step, and in how many frames."""
    schedule = plan.document.firing_schedule
    groups = schedule.groups if schedule else tuple((p.id,) for p in plan.projectors)
    frames = {p.id: n_frames((p,), len(plan.cameras)) for p in plan.projectors}
    return [
        {"on": list(group), "frames": [frames[name] for name in group]}
        for group in groups
    ]


def _zones(plan: RigPlan) -> list[dict[str, Any]]:
    space = plan.requirements.workspace
    room = () if space.box is None else (space.box,)
    kinds = (("room", room), ("mounting plane", space.mounting))

    def shown(kind: str, box: Box) -> dict[str, Any]:
        middle = np.array(space.centre) + box.centre_m
        return {
            **{"kind": kind, "name": box.name, "middle": middle.tolist()},
            **{"axes": np.array(box.axes).tolist(), "half": list(box.half_m)},
        }

    return [
        shown(kind, box)
        for kind, boxes in (*kinds, ("keep out", space.keep_out))
        for box in boxes
    ]


def _obstacles(plan: RigPlan, payload: Payload) -> list[dict[str, Any]]:
    """Add the meshes of those that are shown."""
    found: list[dict[str, Any]] = []
    for k, solid in enumerate(drawn_obstacles(plan)):
        name = f"obstacle{k}"
        box = add_mesh(payload, name, solid.mesh.vertices, solid.mesh.faces)
        found.append({"name": solid.name, "array": name} | box)
    return found


def _half_floats(values: Array) -> Any:  # noqa: ANN401
    """Return values as 16 bit floats in two bytes; NaN, which is nothing, as 0."""
    with np.errstate(over="ignore"):
        halves = values.astype("<f2")
    halves[np.isnan(halves)] = 0.0
    return halves.view(np.uint16)


def _directions(steep: Array) -> Any:  # noqa: ANN401
    """Return unit vectors (n, 3) in steps of 1/32767 about 32768."""
    return (np.rint(32767.0 * steep) + 32768).astype(np.uint16)
