"""What `plan export` does, and prints of each format."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from planning.cli.console import given, print_json, reporter, writable
from planning.handover.export.export_formats import FORMATS
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.mitsuba_export import NAME, mitsuba_lacks, write_mitsuba
from planning.handover.export.write_exports import README, Exported, write_export
from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.scene_text import SceneError

_FOLDER = "export"
# More files than these are counted.
_MOST_NAMED = 6


def export_command(options: Mapping[str, Any]) -> int:
    """Write a plan's formats; return 1 if one can't hold all of the plan."""
    path, targets = Path(options["plan_file"]), options["targets"]
    plan = RigPlan.load(path)
    frame = frame_of(options["frame"], plan.requirements.workspace)
    rig = ExportedRig.of(plan, frame)
    if targets == (NAME,):
        return _mitsuba_alone(rig, options["output"] or path.parent / NAME, options)
    base = options["output"] or path.parent / _FOLDER
    written: list[Exported] = []
    try:
        for one in _each(rig, base, options):
            written.append(one)
    except KeyboardInterrupt:
        if not written:
            raise
        done = ", ".join(each.name for each in written)
        raise KeyboardInterrupt(f"interrupted; {base} has {done}, complete") from None
    if options["as_json"]:
        print_json(
            {
                "frame": frame.words,
                "exports": [
                    {
                        "format": each.name,
                        "folder": str(each.folder),
                        "files": list(each.files),
                        "left_out": list(each.lacks),
                    }
                    for each in written
                ],
            }
        )
    else:
        click.echo("\n".join(line for each in written for line in _lines(each)))
        click.echo(f"frame: {frame.words}; each README.txt has axes and units")
    return int(any(each.lacks for each in written))


def _each(
    rig: ExportedRig, base: Path, options: Mapping[str, Any]
) -> Iterator[Exported]:
    report = reporter(quiet=options["quiet"])
    for name in options["targets"]:
        report(f"writing {name}")
        yield _written(rig, name, base / name, options)


def _written(
    rig: ExportedRig, name: str, folder: Path, options: Mapping[str, Any]
) -> Exported:
    forms = {form.name: form for form in FORMATS}
    try:
        with writable(folder):
            if name in forms:
                return write_export(rig, forms[name], folder)
            scenes = _scenes(rig, folder, options)
    except SceneError as error:
        # One format's refusal mustn't cost the others.
        return Exported(name, folder, (), (f"nothing written: {error}",))
    files = (*(scene.name for scene in scenes), README)
    return Exported(name, folder, files, tuple(mitsuba_lacks(rig)))


def _mitsuba_alone(rig: ExportedRig, folder: Path, options: Mapping[str, Any]) -> int:
    with writable(folder):
        reporter(quiet=options["quiet"])("drawing the patterns")
        scenes = _scenes(rig, folder, options)
    lacks = mitsuba_lacks(rig)
    if options["as_json"]:
        paths = [str(scene) for scene in scenes]
        print_json({"folder": str(folder), "scenes": paths, "left_out": lacks})
    else:
        names = ", ".join(scene.name for scene in scenes)
        cameras = count_words(len(rig.plan.cameras), "camera")
        click.echo(f"{folder}: {names} with {cameras} each, see README.txt")
        click.echo("".join(f"  {lack}\n" for lack in lacks), nl=False)
    return int(bool(lacks))


def _scenes(rig: ExportedRig, folder: Path, options: Mapping[str, Any]) -> list[Path]:
    surface = Surface(**given(options, "albedo", "texture"))
    return write_mitsuba(rig, folder, surface, options["ambient"])


def _lines(each: Exported) -> list[str]:
    names, more = each.files[:_MOST_NAMED], len(each.files) - _MOST_NAMED
    words = ", ".join(names) + (f" and {more} more" if more > 0 else "")
    words = words or "no file"
    return [f"{each.folder}: {words}", *(f"  {lack}" for lack in each.lacks)]
