"""What `plan lens` does: which optics suit an object, without planning."""

from collections.abc import Iterator, Mapping
from typing import Any

import click

from geometry.files.readers import load_mesh
from planning.cli.console import print_json
from planning.cli.lines.object_lines import size_lines
from planning.model.words import percent
from planning.rig.devices.edge_optics import farthest_off, straighter_focus
from planning.rig.devices.lens_fit import LensFit
from planning.rig.devices.rig_devices import drawn_edges
from planning.rig.rig import load_rig

# Edges that lie off by more are worth another focus [px of the projector].
STRAIGHT_PX = 0.02


def lens_command(options: Mapping[str, Any]) -> int:
    """Print fields, sharpness and what would fit; return 0."""
    rig = load_rig(options["rig_name"], light=options["light"], checked=False)
    mesh = load_mesh(options["mesh"], unit=options["unit"], size_mm=options["size_mm"])
    fits = rig.fits(mesh)
    if options["as_json"]:
        print_json({fit.role: fit.to_document() for fit in fits})
        return 0
    lines = [*size_lines(mesh)]
    for fit in fits:
        lines += ["", f"{fit.role.upper()}: {fit.table.name}"]
        lines += [f"  {line}" for line in _lines(fit)]
    click.echo("\n".join(lines))
    return 0


def _edge_words(fit: LensFit) -> str:
    """How far ring edges lie off by the panel's pixels, and which focus is better."""
    drawn = drawn_edges(fit.table, fit.device)
    off_px, at_m = farthest_off(drawn, fit.device, fit.depths_m)
    off_mm = 1e3 * off_px * fit.device.pixel_m(at_m)
    words = (
        f"ring edges lie {off_px:.3f} px ({off_mm:.3f} mm) off their rings or less, "
        f"before the camera's own blur; most at {1e3 * at_m:.0f} mm"
    )
    if off_px <= STRAIGHT_PX:
        return words
    better = straighter_focus(drawn, fit.device, fit.depths_m, STRAIGHT_PX)
    if better is None or better.focus_m is None:
        return words
    return (
        f"{words}; focused at {1e3 * better.focus_m:.0f} mm {STRAIGHT_PX:g} px or less"
    )


def _lines(fit: LensFit) -> Iterator[str]:
    """How a device suits the object, and which lens, focus and standoff would."""
    across = " x ".join(f"{1e3 * side:.4g}" for side in fit.field_m)
    yield (
        f"{fit.lens_words(fit.device)}: a field of {across} mm at the standoff of "
        f"{1e3 * fit.standoff_m:g} mm"
    )
    whole = "" if fit.images == 1 else f", and one view of it takes {fit.images} images"
    yield (
        f"the object, {2e3 * fit.radius_m:.1f} mm across, fills {percent(fit.share)} "
        f"of the image, as a mean over all directions{whole}"
    )
    near, far = (f"{1e3 * depth:.0f}" for depth in fit.depths_m)
    low, high = (f"{1e3 * end:.0f}" for end in fit.device.range_m)
    yield (
        f"sharp from {low} to {high} mm; what faces it is {near} to {far} mm away, "
        f"{'all' if fit.is_sharp else 'NOT all'} of it sharp"
    )
    yield f"as it is: {fit.lens_words(fit.device)} {fit.focus_words(fit.device)}"
    yield f"at best: {fit.advice()}"
    if fit.role == "projector":
        yield _edge_words(fit)
    away = fit.standoff_that_holds_m
    if away is not None:
        yield f"as it is it shows all of it from a standoff of {1e3 * away:.0f} mm on"
