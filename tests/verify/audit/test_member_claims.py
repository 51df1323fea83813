"""Who calls itself a member: of one mesh the plan itself, or one of a family's."""

import pytest

from planning.verify.audit.audit import audit_plan
from planning.verify.trust import OF_MEMBER, taken_on_trust


def told(plan):
    found = audit_plan(plan, n_samples=100).failures
    return [sentence for sentence in found if sentence.startswith("members")]


def named(document, **asked):
    document["members"][0]["name"] = "face"
    document["requirements"] |= {"region_coverage": 0.0} | asked


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d["members"].clear(), "members: 0 of 1 meshes"),
        (lambda d: d["members"].append(d["members"][0]), "members: 2 of 1 meshes"),
        (lambda d: d["meshes"].append(d["meshes"][0]), "members: 1 of 2 meshes"),
        (lambda d: d["members"][0].update(mesh=1), "members.0.mesh: differs"),
        (
            lambda d: named(d, region_coverage=0.3),
            "members.0.name: 'face' is of a family, and no family has "
            "requirements.region_coverage",
        ),
        (
            lambda d: named(d, survival={"views": 2, "survive": 0}),
            "members.0.name: 'face' is of a family, and no family has "
            "requirements.survival",
        ),
    ],
)
def test_what_is_no_member_is_named(handmade, change, sentence):
    plan = handmade.build_plan()
    assert told(plan) == []
    (found,) = told(handmade.tampered(plan, change))
    assert found.startswith(sentence)


def test_what_nobody_knows_of_a_lone_member_is_told(handmade):
    """Its ball is its family's, and the family isn't there."""
    plan = handmade.build_plan()
    member = handmade.tampered(plan, named)
    assert told(member) == []
    assert OF_MEMBER in taken_on_trust(member, None, "", "")
    assert OF_MEMBER not in taken_on_trust(plan, None, "", "")
