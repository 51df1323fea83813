"""Less work than a plan rests on, where a test isn't about how much there is."""

import os
import sys
from dataclasses import replace

from geometry.repair import hollow
from planning.cameras import camera_baselines
from planning.cameras.paper import hole_closing
from planning.projectors import share_margin
from planning.proofs import camera_bound, marginals, projector_bound
from planning.report import offered_again
from planning.rig.rig import Rig
from planning.scene.draws import DRAWS
from planning.verify.audit.audit_case import examine
from planning.verify.audit.coverage import inside_claims

# Of the work on bounds over all poses, which most plans spend most of their time on.
_SHARE = 0.1
# Samples that devices, rings and claims rest on, and that confirm what others were
# fitted to.
_FEW = {
    "site": 1000,
    "projectors": 1200,
    "cameras": 1200,
    "axes": 2000,
    "surer": 2000,
    "rings": 3000,
    "claims": 2500,
    "overlaps": 2500,
    "fresh_projectors": 4000,
    "fresh_cameras": 2000,
    "baselines": 2000,
    "confirming_baselines": 4000,
}
# Fresh samples that an audit looks at where its caller doesn't say how many.
_AUDITED = 4000
# Spots that tell hollow from solid, what the audit then reckons with, and its own.
_LOOKING = (
    (hollow, "_SPOTS", 4000),
    (inside_claims, "_PLANNER_SPOTS", 3000),
    (inside_claims, "_MAX_SAMPLES", 1500),
)
# Poses of projectors and cameras offered; a rig file can ask for 600 and 400 at least.
_POSES = 160, 120
# Samples that devices and rings are fitted to, and that confirm them, where a plan is
# compared with itself: whatever it is, both are.
_FEWEST = {
    "site": 600,
    "projectors": 500,
    "fresh_projectors": 1000,
    "cameras": 500,
    "fresh_cameras": 1000,
    "axes": 500,
    "surer": 500,
    "baselines": 500,
    "confirming_baselines": 1000,
    "rings": 1000,
    "claims": 1500,
    "overlaps": 1500,
}
# What a process of its own runs first, to work little; and where it finds that.
LITTLE = "import pytest\nfrom support.little_work import work_little\n"
LITTLE += "work_little(pytest.MonkeyPatch())\n"


def found_path():
    """Return a PYTHONPATH on which a process finds what this one does."""
    return os.pathsep.join(filter(None, sys.path))


def work_little(patch, *, every_pose=False):
    """Let claims, confirmations and audits rest on few samples, bounds cost little.

    And few poses be offered, unless `every_pose`.
    """
    draw_fewer(patch, **_FEW)
    for module, name, count in _LOOKING:
        patch.setattr(module, name, count)
    bound_roughly(patch)
    search_briefly(patch)
    patch.setitem(examine.__kwdefaults__, "n_samples", _AUDITED)
    if not every_pose:
        offer_fewer(patch)


def work_least(patch):
    """Let all rest on few samples, where plans are compared with each other alone."""
    work_little(patch)
    draw_fewer(patch, **_FEWEST)


def draw_fewer(patch, **counts):
    """Let draws hold so many samples, by their names, until `patch` is undone."""
    for name, count in counts.items():
        draw = replace(getattr(DRAWS, name), count=count)
        patch.setitem(vars(DRAWS), name, draw)


def offer_fewer(patch, projectors=_POSES[0], cameras=_POSES[1]):
    """Let fewer poses be offered than a rig file can ask for, until it is undone."""
    patch.setattr(Rig, "n_projector_poses", projectors)
    patch.setattr(Rig, "n_camera_poses", cameras)
    least = {"projector": projectors, "camera": cameras}
    patch.setattr(offered_again, "_LEAST", least)


def bound_roughly(patch):
    """Let bounds over all poses cost little, until `patch` is undone."""
    for bound in (camera_bound, projector_bound):
        less = replace(bound.DEFAULT, budget=_SHARE * bound.DEFAULT.budget, shadows=0.0)
        patch.setattr(bound, "DEFAULT", less)


def search_briefly(patch):
    """Let what is proved or allowed already be bettered less, until it is undone."""
    for module, name, share in (
        (camera_baselines, "_CAMERA_PROGRAMS", 0.1),
        (hole_closing, "_PROGRAMS", 0.3),
        (marginals, "_MARGINAL_BUDGET", _SHARE),
        (marginals, "DEFAULT_BUDGET", _SHARE),
        (share_margin, "_BUDGET", _SHARE),
        (share_margin, "_STEP_RAD", 4.0),
    ):
        whole = getattr(module, name)
        patch.setattr(module, name, type(whole)(share * whole))
