"""`--joint`: what it is refused with, and a whole plan of both kinds together."""

from dataclasses import replace

import numpy as np
import pytest
from support.little_work import draw_fewer
from support.plain_shapes import box

from geometry.shapes.sample_head.sample_head import sample_head
from planning import load_rig, pipeline
from planning.model.errors import InputError, RigError
from planning.report.partial_plan import PlanRequest
from planning.report.summary.shortfall import shortfalls
from planning.report.summary.summary import summary
from planning.rig.wishes import Wishes
from planning.steps.joint import joining, moves, offer
from planning.steps.joint.completed import Costs, cameras_proved, projector_stage
from planning.steps.joint.joining import check_joint
from planning.steps.joint.moves import wider_slack
from planning.steps.joint.offer import joint_offer
from planning.verify.audit.audit import audit_plan
from solvers.joint.joint_cover import solve_joint

_BODY = {"size_mm": [90.0, 90.0, 150.0], "centre_mm": [0.0, 0.0, -80.0]}


def asked(rig=None, *, evaluates=False, cameras_by="both", **wishes):
    wishes = Wishes(3, joint=True, **wishes)
    return PlanRequest(
        box((0.1, 0.1, 0.1)),
        rig or load_rig(),
        wishes,
        evaluates=evaluates,
        cameras_by=cameras_by,
    )


def test_what_is_planned_in_two_stages_is_asked_for_without():
    check_joint(asked())
    for request, words in (
        (asked(survive=1), "survive = 1"),
        (asked(views=2), "views = 2"),
        (asked(robust=0.9), "robust"),
        (asked(pattern="none"), "pattern = 'none'"),
        (asked(cameras_by="paper"), "cameras_by = 'paper'"),
        (asked(evaluates=True), "an evaluation"),
    ):
        with pytest.raises(InputError, match=f"joint with {words}"):
            check_joint(request)


def test_devices_with_bodies_or_that_stand_are_refused():
    rig = load_rig()
    stands = [
        {
            "kind": "camera",
            "name": "C",
            "position_mm": [0.0, -1000.0, 0.0],
            "aim_mm": [0.0, 0.0, 0.0],
        }
    ]
    with pytest.raises(InputError, match="joint with existing devices"):
        check_joint(asked(rig.replace(existing=stands)))
    with pytest.raises(InputError, match="gives a camera a body"):
        check_joint(asked(rig.replace(camera={"body": _BODY})))


def test_devices_that_come_together_are_refused():
    with pytest.raises(InputError, match=r"joint with a \[head\]"):
        check_joint(asked(load_rig("gom-atos-core-300")))


def test_costs_are_stated_of_all_models_or_of_none():
    rig = load_rig()
    with pytest.raises(InputError, match="write cost for each model, or for none"):
        check_joint(asked(rig.replace(camera={"cost": 400.0})))
    both = rig.replace(camera={"cost": 400.0}, projector={"cost": 1200.0})
    check_joint(asked(both))
    document = both.to_document()
    assert document["camera"]["cost"] == 400.0
    assert "cost" not in document["camera"]["figures"]


@pytest.mark.parametrize("cost", ["0", "-1", "nan", "'much'"])
def test_a_cost_is_a_positive_number(cost, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(f"base = 'default'\nname = 'dear'\n[camera]\ncost = {cost}\n")
    with pytest.raises(RigError, match=r"camera\.cost"):
        load_rig(path)


def test_the_command_refuses_in_one_line(tmp_path, small_job):
    mesh, solid = tmp_path / "box.obj", box((100.0, 100.0, 100.0))
    corners = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    faces = [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]
    mesh.write_text("\n".join([*corners, *faces]))
    ended = small_job.run(mesh, tmp_path, ["--joint", "--survive", "1"])
    assert ended.code == 3
    assert ended.lines == 1
    assert "joint with survive = 1" in ended.message


@pytest.fixture(scope="module")
def planned(with_little_work):
    """A plan of a coarse head from few candidates, and the two stages before it."""
    rig = load_rig().replace(
        calibration={"angle_deg": 0.0, "position_mm": 0.0},
        placement={
            "n_candidate_projectors": 40,
            "n_candidate_cameras": 40,
            "n_reference_projectors": 600,
            "n_reference_cameras": 400,
        },
        camera={"cost": 2.0},
        projector={"cost": 3.0},
    )
    two_stages, inner = [], joining.jointly

    def spied(planned):
        def kept(*args):
            two_stages.append(planned(*args))
            return two_stages[-1]

        return inner(kept)

    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, joint=400, joint_margins=2000)
        patch.setattr(offer, "_OFFERED", 14)
        patch.setattr(joining, "_COVERS", 12)
        patch.setattr(joining, "_WORK", 1e6)
        patch.setattr(moves, "_SCALES", (0.25,))
        patch.setattr(moves, "_AROUND", 6)
        patch.setattr(pipeline, "jointly", spied)
        plan = pipeline.plan_rig(
            sample_head(n_faces=1200),
            rig,
            max_projectors=6,
            region_coverage=0.0,
            joint=True,
            cameras_by="cover",
            check=False,
            threads=1,
            on_miss="return",
        )
        yield plan, *two_stages[0]


@pytest.mark.long
def test_it_is_no_dearer_and_no_narrower_than_the_two_stages(planned):
    plan, first, _ = planned
    record = plan.document.joint
    assert record.two_stage.projectors == len(first.projectors)
    assert record.two_stage.cameras == len(first.cameras)
    assert record.two_stage.cost == 3 * len(first.projectors) + 2 * len(first.cameras)
    assert record.joint.cost == 3 * len(plan.projectors) + 2 * len(plan.cameras)
    assert record.joint.cost <= record.two_stage.cost
    assert record.lower_bound <= record.needed <= record.two_stage.cost
    assert record.margin_before <= record.margin
    assert not shortfalls(plan)


@pytest.mark.long
def test_the_audit_finds_it_true_and_the_summary_tells_of_it(planned):
    plan, *_ = planned
    audit = audit_plan(plan, n_samples=4000, threads=1)
    assert audit.failures == ()
    assert audit.unmet == ()
    text = summary(plan, (), ())
    assert "JOINT    " in text
    assert f"{plan.document.joint.over.projectors} projectors and" in text


@pytest.mark.long
def test_what_is_proposed_doesnt_depend_on_threads(planned):
    _, _, partial = planned
    found = []
    for threads in (1, 3):
        scene = replace(partial.scene, threads=threads)
        ready = replace(partial.ready, scene=scene)
        offered = joint_offer(replace(partial, ready=ready))
        rig = Costs(partial_rig(partial)).rig
        answer = solve_joint(
            offered.problem(rig), known=offered.own, n_covers=6, budget=1e6
        )
        moved = wider_slack(replace(partial, ready=ready), offered)
        poses = [d.world_from_device for kind in moved or () for d in kind]
        found.append((offered.tables.slack, answer.projectors, answer.cameras, *poses))
    one, other = found
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a, b)


@pytest.mark.long
def test_numbers_other_than_the_fewest_are_told_as_such(planned):
    _, _, partial = planned
    own, one = partial.projectors, partial.stage.candidates.projectors[0]
    fewest = partial.stage.certificate
    assert fewest.needed.lower_bound == len(own)

    more = projector_stage(partial, (*own, one))
    as_many = projector_stage(partial, own)

    assert more.certificate.count == more.certificate.needed.count == len(own) + 1
    assert more.certificate.status == "feasible"
    assert as_many.certificate.count == len(own)
    # Fewer than are proved to be needed light too little.
    assert projector_stage(partial, own[:-1]) is None


@pytest.mark.long
def test_cameras_are_proved_again_for_their_projectors(planned):
    _, _, partial = planned
    cameras = (*partial.cameras, partial.camera_stage.cover.candidates.cameras[0])

    stage = cameras_proved(partial, partial.projectors, cameras)

    assert stage.cameras == cameras
    assert stage.certificate.count == len(cameras)
    assert stage.certificate.needed.lower_bound <= len(partial.cameras)
    assert cameras_proved(partial, partial.projectors, partial.cameras[:1]) is None


def partial_rig(partial):
    from planning.model.document.input_records import RigRecord

    return RigRecord(**partial.request.rig.to_document())
