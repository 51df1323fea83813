"""What `plan export` does."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.scene_files import write_scenes
from planning.verify.reconstruction.scanner import Scanner

from .console import given, print_json, reporter, writable


def export_command(options: Mapping[str, Any]) -> int:
    """Write a scene for each projector of a plan; print where they are."""
    path, report = Path(options["plan_file"]), reporter(quiet=options["quiet"])
    scanner = Scanner.of(RigPlan.load(path))
    folder = options["output"] or path.parent / options["target"]
    with writable(folder):
        report("drawing the patterns")
        scenes = write_scenes(
            scanner,
            folder,
            Surface(**given(options, "albedo", "texture")),
            **{"ambient": scanner.limits.check.ambient} | given(options, "ambient"),
        )
    if options["as_json"]:
        print_json({"folder": str(folder), "scenes": [str(scene) for scene in scenes]})
    else:
        names = ", ".join(scene.name for scene in scenes)
        cameras = count_words(len(scanner.cameras), "camera")
        click.echo(f"{folder}: {names} with {cameras} each, see README.txt")
    return 0
