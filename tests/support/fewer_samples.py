"""Fewer samples than a plan rests on, where a test isn't about their number."""

from dataclasses import replace

from planning.scene.draws import DRAWS


def draw_fewer(patch, **counts):
    """Let draws hold so many samples, by their names, until `patch` is undone."""
    for name, count in counts.items():
        draw = replace(getattr(DRAWS, name), count=count)
        patch.setitem(vars(DRAWS), name, draw)
