"""What detecting and estimating leaves make of a view in which the object is not, or hardly, to be seen."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.perception import beliefs
from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Pose, YawSet
from bestman_bt.perception.detection.base import LabelledCluster
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.world_model.world_model import ObjectBelief
from tests.behaviours.scripted import ASKEW, codes, load, map_from, run, scripted_skills

DETECT = '<DetectObject object="cup" surface="table" pose="{pose}" min_confidence="0.6"/>'
ESTIMATE = '<EstimatePose object="cup" pose="{pose}" min_confidence="0.6"/>'
BEFORE = 40.0
SCENE = SimpleNamespace(detections=(), unknown=(), plane=None)


def belief(skills: Any, stamp: float, confidence: float = 0.9, x: float = 0.7) -> ObjectBelief:
    pose = Pose(map_from(ASKEW, x, 0.0, 0.8))
    return ObjectBelief("cup", skills.world.models["cup"], pose, confidence, 0.002, stamp)


@pytest.fixture
def skills(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A camera and a detector; ``skills.after_view``: what is believed of the cup after a view, None for as before."""
    skills = scripted_skills()
    skills.after_view = None

    def believe(skills_of_leaf: Any, *_: Any) -> tuple[str, ...]:
        if skills.after_view is not None:
            skills.world.objects[skills.after_view.name] = skills.after_view
        return tuple(skills.world.objects)

    view = SimpleNamespace(map_from_base=ASKEW.to_pose(), in_base=None, stamp=skills.clock.now())
    skills.camera = SimpleNamespace(capture=lambda: view)
    skills.detection = SimpleNamespace(detect=lambda *_: SCENE)
    monkeypatch.setattr("behaviours.perception.perceive.surface_region", lambda *_: None)
    monkeypatch.setattr("behaviours.perception.perceive.believe_surface", believe)
    monkeypatch.setattr("behaviours.perception.perceive.believe_objects", believe)
    monkeypatch.setattr("behaviours.perception.perceive.only_nearest", lambda *_: SCENE)
    return skills


@pytest.mark.parametrize(("leaf", "code"), [(DETECT, "not_found"), (ESTIMATE, "object_lost")])
def test_an_object_that_is_hidden_now_is_not_found_though_it_was_seen_before(skills: Any, leaf: str, code: str) -> None:
    skills.world.objects["cup"] = belief(skills, BEFORE)
    tree = load(skills, leaf)
    assert run(skills, tree) == FAILURE
    assert codes(skills) == [code]
    assert tree.blackboard.get("pose") is None
    skills.after_view = belief(skills, skills.camera.capture().stamp, x=0.8)
    assert run(skills, tree) == SUCCESS
    np.testing.assert_allclose(tree.blackboard.get("pose").position, map_from(ASKEW, 0.8, 0.0, 0.8))


@pytest.mark.parametrize("leaf", [DETECT, ESTIMATE])
@pytest.mark.parametrize(("confidence", "status"), [(0.59, FAILURE), (0.61, SUCCESS)])
def test_an_object_has_to_be_seen_as_surely_as_is_asked(skills: Any, leaf: str, confidence: float, status: int) -> None:
    skills.world.objects["cup"] = belief(skills, BEFORE)
    skills.after_view = replace(belief(skills, skills.clock.now()), confidence=confidence)
    assert run(skills, load(skills, leaf)) == status


def test_an_object_without_a_model_that_was_never_seen_is_unknown_and_one_with_a_model_not_found(skills: Any) -> None:
    assert run(skills, load(skills, DETECT.replace("cup", "unicorn"))) == FAILURE
    assert run(skills, load(skills, DETECT)) == FAILURE
    assert run(skills, load(skills, ESTIMATE)) == FAILURE
    assert codes(skills) == ["unknown_object", "not_found", "not_found"]


def test_a_camera_that_the_robot_does_not_have_is_reported(skills: Any) -> None:
    for name in ("wrist", "ceiling"):
        assert run(skills, load(skills, f'<DetectObject object="cup" surface="table" camera="{name}"/>')) == FAILURE
    assert codes(skills) == ["no_camera", "no_camera"]
    skills.wrist_camera, skills.camera = skills.camera, None
    skills.after_view = belief(skills, skills.clock.now())
    assert run(skills, load(skills, '<DetectObject object="cup" surface="table" camera="wrist"/>')) == SUCCESS


@pytest.mark.parametrize(("confidence", "status"), [(0.59, FAILURE), (0.6, SUCCESS)])
def test_views_that_fit_together_less_surely_than_is_asked_change_no_belief(
    skills: Any, monkeypatch: pytest.MonkeyPatch, confidence: float, status: int
) -> None:
    before = skills.world.objects["cup"] = replace(belief(skills, BEFORE), yaw_set=YawSet(((0.0, 1.0),)))
    seen = SimpleNamespace(cluster=SimpleNamespace(seen_from=lambda pose: None))
    view = SimpleNamespace(map_from_base=ASKEW.to_pose(), in_base=None, in_map=None, stamp=skills.clock.now())
    skills.wrist_camera = SimpleNamespace(capture=lambda: view)
    skills.observations["cup"] = ["an earlier view"]
    joined = SimpleNamespace(pose=Pose(), confidence=confidence, position_std=0.001, yaw_set=YawSet(((0.0, 0.1),)))
    skills.multi_view = SimpleNamespace(estimate=lambda *_: (joined,))
    monkeypatch.setattr("behaviours.manipulation.next_best_view.SecondLook._postures", lambda *_: [np.zeros(7)])
    monkeypatch.setattr("behaviours.manipulation.next_best_view.move_free", lambda *_: ())
    monkeypatch.setattr("behaviours.manipulation.next_best_view.remember_view", lambda *_: None)
    monkeypatch.setattr(
        "behaviours.manipulation.next_best_view.only_nearest", lambda *_: SimpleNamespace(detections=(seen,))
    )
    monkeypatch.setattr("bestman_bt.perception.pose_estimation.multi_view.ViewObservation", lambda *_: None)
    assert run(skills, load(skills, '<SecondLook object="cup" min_confidence="0.6"/>')) == status
    assert (skills.world.objects["cup"] is before) is (status == FAILURE)
    assert codes(skills) == (["object_lost"] if status == FAILURE else [])


@pytest.mark.parametrize(("name", "confidence"), [("cup", 0.0), ("banana", 1.0)])
def test_a_named_thing_that_its_model_does_not_fit_has_no_confidence_and_one_without_a_model_is_a_box(
    skills: Any, name: str, confidence: float
) -> None:
    points = np.random.default_rng(0).uniform(0.0, 0.1, (200, 3))
    plane = SupportPlane(Pose(), (1.0, 1.0), points, 0.001)
    cluster = LabelledCluster(points, np.zeros((200, 3), np.uint8), plane, False, name, 0.6)
    in_map = SimpleNamespace(viewpoint=np.zeros(3))
    view: Any = SimpleNamespace(map_from_base=Pose(), in_map=in_map, stamp=skills.clock.now())
    thing = beliefs.believed_thing(view, cluster, "table", [model.name for model in skills.world.models.values()])
    assert (thing.confidence, thing.recognised) == (confidence, False)
    skills.after_view = thing
    tree = load(skills, DETECT.replace("cup", name))
    assert run(skills, tree) == (SUCCESS if confidence else FAILURE)
    if confidence:
        assert tree.root.feedback_message == "banana by its measured box, no model fits, score 0.60"


def test_the_score_of_a_detector_is_reported_beside_the_confidence(skills: Any) -> None:
    detect = DETECT.replace("<DetectObject", '<DetectObject score="{score}"')
    seen = belief(skills, skills.clock.now())
    skills.after_view = replace(seen, score=0.8)
    tree = load(skills, detect)
    assert run(skills, tree) == SUCCESS
    assert tree.root.feedback_message == "cup with confidence 0.90, score 0.80"
    assert tree.blackboard.get("score") == 0.8
    skills.after_view = seen
    tree = load(skills, detect)
    assert run(skills, tree) == SUCCESS
    assert tree.root.feedback_message == "cup with confidence 0.90"
