"""The cone of a region: the angle about its mean normal that holds 98 % of its area."""

from types import SimpleNamespace

import numpy as np
import pytest

from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.coverage.region_claims import _audit_cone

UP = np.array([0.0, 0.0, 1.0])


def audited(claimed, angles):
    """What is found of a claim about faces of one size, so far off the mean normal."""
    angles, findings = np.array(angles), AuditFindings()
    normals = np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)])
    region = SimpleNamespace(mean_normal=UP, cone_angle=claimed)
    _audit_cone(region, normals, np.full(len(angles), 0.1 / 3.0), findings)
    return findings.failures


@pytest.mark.parametrize(("claimed", "well"), [(0.2, True), (0.7, False), (0.4, False)])
def test_it_holds_98_percent_of_the_area(claimed, well):
    assert (audited(claimed, [0.1] * 190 + [0.2] * 7 + [0.7] * 3) == ()) == well


@pytest.mark.parametrize(("claimed", "well"), [(0.2, True), (0.7, True), (0.4, False)])
def test_where_equal_faces_are_98_percent_rounding_says_which_is_the_last(
    claimed, well
):
    assert (audited(claimed, [0.1] * 30 + [0.2] * 19 + [0.7]) == ()) == well
