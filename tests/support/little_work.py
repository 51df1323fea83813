"""Less work than a plan rests on, where a test isn't about how much there is."""

from dataclasses import replace

from planning.proofs import camera_bound, projector_bound
from planning.scene.draws import DRAWS

# Of the work on bounds over all poses, which most plans spend most of their time on.
_SHARE = 0.1
# Samples that claims rest on, and that confirm what others were fitted to. Covers are
# chosen, and rings spaced, on as many as ever.
_FEW = {
    "claims": 3000,
    "overlaps": 3000,
    "fresh_projectors": 4000,
    "fresh_cameras": 2000,
    "baselines": 2000,
    "confirming_baselines": 4000,
}


def work_little(patch):
    """Let claims and confirmations rest on few samples, and bounds cost little."""
    draw_fewer(patch, **_FEW)
    bound_roughly(patch)


def draw_fewer(patch, **counts):
    """Let draws hold so many samples, by their names, until `patch` is undone."""
    for name, count in counts.items():
        draw = replace(getattr(DRAWS, name), count=count)
        patch.setitem(vars(DRAWS), name, draw)


def bound_roughly(patch):
    """Let bounds over all poses cost little, until `patch` is undone."""
    for bound in (camera_bound, projector_bound):
        less = replace(bound.DEFAULT, budget=_SHARE * bound.DEFAULT.budget, shadows=0.0)
        patch.setattr(bound, "DEFAULT", less)
