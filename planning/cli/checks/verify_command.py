"""What `plan verify` does."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from geometry.files.readers import UNITS, load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.cli.checks.planned_again import PlannedAgain
from planning.cli.console import given, print_json, progress
from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.report.made_again import again_or_why_not
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.path_traced import mitsuba
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.photometry import assumed_light
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verification import verify_plan


def verify_command(
    options: Mapping[str, Any],
    asked_again: Callable[[RigPlan, Path | None, str | None], dict[str, Any]],
) -> int:
    """Audit and check a plan; return 0 if every claim holds, 1 if not.

    With `strict` also 1 if anything was taken on trust. Of a plan, and the mesh and rig
    that take their places, `asked_again` says what its command asked for.
    """
    plan = RigPlan.load(options["plan_file"])
    mesh = None
    if options["mesh"] is not None:
        mesh = _same_scale(options["mesh"], plan)
    truth = None if options["truth"] is None else RigPlan.load(options["truth"])
    threads = options["threads"] or n_threads()
    again = again_or_why_not
    if options["replan"]:
        asked = asked_again(plan, options["mesh"], options["rig"])
        again = PlannedAgain(plan, asked, quiet=options["quiet"])
    with progress(quiet=options["quiet"]) as report:
        verification = verify_plan(
            plan,
            mesh,
            truth=truth,
            **_rendering(plan, options, threads),
            seed=options["seed"],
            threads=threads,
            progress=report,
            again=again,
            over_poses=options["proofs"],
        )
    if options["as_json"]:
        print_json(verification.to_document())
    else:
        click.echo(verification.summary())
        if options["strict"] and verification.passed and verification.trusted:
            words = count_words(len(verification.trusted), "thing")
            click.echo(f"NOT verified strictly: {words} taken on trust")
    holds = verification.is_strict if options["strict"] else verification.passed
    return 0 if holds else 1


def _rendering(
    plan: RigPlan, options: Mapping[str, Any], threads: int
) -> dict[str, Any]:
    """Return what Mitsuba is to render; nothing for the built-in renderer."""
    if options["renderer"] == "builtin":
        return {}
    # Before the audit, which takes a minute.
    mitsuba(threads)
    physics = Physics(
        surface=Surface(**given(options, "albedo", "texture")),
        **given(options, "material", "bounces", "spp", "vignetting"),
    )
    light = replace(
        assumed_light(Scanner.of(plan)), **given(options, "ambient", "gamma")
    )
    return {"physics": physics, "photometry": light}


def _same_scale(path: Path, plan: RigPlan) -> TriangleMesh:
    """Read a mesh in the unit of the plan's, or at its size where a size was given."""
    unit = plan.document.meshes[0].unit
    if unit in UNITS:
        return load_mesh(path, unit=unit)
    size = np.ptp(plan.surface.mesh.bounds, axis=0).max()
    return load_mesh(path, size_mm=1e3 * float(size))
