"""A plan of several models of cameras: their claims are held against the rig."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.report.summary.devices.device_lines import used_up
from planning.verify.audit.audit import audit_plan


@pytest.fixture(scope="module")
def of_models(handmade) -> RigPlan:
    """A handmade plan whose first camera is of another model, with the same optics."""
    plan = handmade.build_plan("diverging")
    document, surface = plan.to_document(), plan.surface
    rig, n = document["rig"], len(surface.reference_cameras)
    rig["camera"] |= {"name": "plenty"}
    rig["more_cameras"] = [{**copy.deepcopy(rig["camera"]), "name": "one", "count": 1}]
    for k, record in enumerate(document["cameras"]):
        record["model"] = "plenty" if k else "one"
    stock = [{"kind": "camera", "model": "one", "count": 1}]
    document["requirements"]["stock"] = stock
    models = np.arange(n) % 2
    return RigPlan.from_document(
        document, replace(surface, reference_camera_models=models)
    )


def failures(plan: RigPlan, change) -> str:
    document = plan.to_document()
    change(document)
    told = audit_plan(RigPlan.from_document(document, plan.surface), n_samples=1500)
    return "\n".join(told.failures)


def test_true_claims_of_models_pass(of_models, tmp_path):
    assert failures(of_models, lambda document: None) == ""
    of_models.save(tmp_path / "plan.json")
    again = RigPlan.load(tmp_path / "plan.json")
    assert again.surface.models_of("camera").tolist()[:3] == [0, 1, 0]
    assert not again.surface.models_of("projector").any()


def _two_of_one(document):
    for record in document["cameras"]:
        record["model"] = "one"


def _no_such(document):
    document["cameras"][0]["model"] = "none"


def _more_in_stock(document):
    document["requirements"]["stock"][0]["count"] = 5


def _other_optics(document):
    document["rig"]["more_cameras"][0]["K"][0][0] *= 1.01


def _same_names(document):
    document["rig"]["more_cameras"][0]["name"] = "plenty"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_two_of_one, "are of 'one', of which rig.camera counts 1"),
        (_no_such, "'none' is none of the rig's"),
        (_more_in_stock, "but the rig counts"),
        (_other_optics, "rig.camera.K"),
        (_same_names, "names repeat"),
    ],
)
def test_a_false_claim_of_a_model_is_found(of_models, change, words):
    assert words in failures(of_models, change)


def test_every_model_is_among_the_reference_poses(of_models):
    first = np.zeros(len(of_models.surface.reference_cameras), dtype=np.int64)
    surface = replace(of_models.surface, reference_camera_models=first)
    told = audit_plan(RigPlan(of_models.document, surface), n_samples=1500).failures
    assert any("reference_camera_models: [" in line for line in told)


def test_models_that_the_rig_lacks_are_refused_as_a_file(of_models, tmp_path):
    surface = of_models.surface
    beyond = np.full(len(surface.reference_cameras), 2)
    RigPlan(of_models.document, replace(surface, reference_camera_models=beyond)).save(
        tmp_path / "plan.json"
    )
    with pytest.raises(PlanFileError, match=r"names models 2 to 2, the rig has 2"):
        RigPlan.load(tmp_path / "plan.json")


@pytest.mark.parametrize(
    "terms", [(0.0, 0.0, -30.0, 0.0, 0.0), (-1e100, 0.0, 0.0, 0.0, 0.0)]
)
@pytest.mark.parametrize("of_rig", [False, True])
def test_a_lens_that_folds_its_image_is_refused(of_models, of_rig, terms):
    """A camera's, and that of a model of which reference cameras alone may be."""
    document = of_models.to_document()
    listed = document["rig"]["more_cameras"] if of_rig else document["cameras"]
    listed[0]["distortion"] = list(terms)
    with pytest.raises(PlanFileError, match="folds the image") as refused:
        RigPlan.from_document(document, of_models.surface)
    assert len(str(refused.value).splitlines()) == 1


def test_more_of_a_counted_model_is_what_helps(handmade):
    """Of one model, too: a larger limit would find no other camera."""
    document = handmade.build_plan("diverging").to_document()
    document["rig"]["camera"] |= {"name": "eye", "count": len(document["cameras"])}
    plan = RigPlan.from_document(document, handmade.build_plan("diverging").surface)
    assert used_up(plan.document, "camera") == f"eye ({len(document['cameras'])})"
    assert used_up(plan.document, "projector") == ""
    document["rig"]["camera"]["count"] += 1
    plan = RigPlan.from_document(document, plan.surface)
    assert used_up(plan.document, "camera") == ""
