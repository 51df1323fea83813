"""What is told of rings as they are written: of the rounded pose and radii alone.

So whoever has the plan file tells the same of them again.
"""

from dataclasses import replace

import numpy as np

from planning.model.devices.planned import PlannedProjector
from planning.model.document.ring_records import RingsRecord
from planning.scene.scene import Scene

from .ring_creases import find_creases
from .ring_limits import ring_beam
from .ring_stage import rings_record


def evenly_ringed(
    projector: PlannedProjector, record: RingsRecord | None
) -> PlannedProjector:
    """Return a projector with as many rings at equal steps as there were at first.

    As it is where nothing is told of its rings.
    """
    if record is None:
        return projector
    outer, n = max(*projector.ring_radii, *record.left_out), record.n_even
    return replace(projector, ring_radii=outer * np.arange(1, n + 1) / n)


def told_again(
    scene: Scene, projector: PlannedProjector, record: RingsRecord
) -> RingsRecord:
    """Return what is told of a written projector's rings; how they were spaced, stays.

    Bodies of planned devices stand in the scene.
    """
    every = np.sort(np.concatenate([projector.ring_radii, record.left_out]))
    creases = find_creases(scene.mesh, 0.5 * scene.mesh.mean_edge)
    told = rings_record(
        scene,
        ring_beam(scene, evenly_ringed(projector, record), creases),
        replace(projector, ring_radii=every),
        creases,
        kept_even=record.kept_even,
    )
    left = {"left_out": record.left_out} if record.left_out else {}
    return told.changed(spacing=record.spacing, n_even=record.n_even, **left)
