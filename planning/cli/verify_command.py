"""What `plan verify` does."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from geometry.files.readers import UNITS, load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.verify.verification import verify_plan

from .console import print_json, reporter


def verify_command(options: Mapping[str, Any]) -> int:
    """Audit and check a plan; return 0 if every claim holds, 1 if not."""
    report = reporter(quiet=options["quiet"])
    plan = RigPlan.load(options["plan_file"])
    mesh = None
    if options["mesh"] is not None:
        mesh = _same_scale(options["mesh"], plan)
    truth = None if options["truth"] is None else RigPlan.load(options["truth"])
    verification = verify_plan(
        plan,
        mesh,
        truth=truth,
        seed=options["seed"],
        threads=options["threads"] or n_threads(),
        progress=report,
    )
    if options["as_json"]:
        print_json(verification.to_document())
    else:
        click.echo(verification.summary())
    return 0 if verification.passed else 1


def _same_scale(path: Path, plan: RigPlan) -> TriangleMesh:
    """Read a mesh in the unit of the plan's, or at its size where a size was given."""
    unit = plan.document.meshes[0].unit
    if unit in UNITS:
        return load_mesh(path, unit=unit)
    size = np.ptp(plan.surface.mesh.bounds, axis=0).max()
    return load_mesh(path, size_mm=1e3 * float(size))
