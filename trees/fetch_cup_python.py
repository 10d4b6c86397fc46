"""The tree of fetch_cup.xml, written in Python: the same nodes, the same behaviour.

bestman-bt run fetch_cup_python --task fetch_cup
"""

from __future__ import annotations

from behaviours.grasp import Grasp, Holding, PlanGrasp, Reachable
from behaviours.look import LookAt
from behaviours.move_arm import MoveArm, Retreat
from behaviours.navigate import NavigateTo
from behaviours.object_conditions import BelievedSurface, ObjectAt
from behaviours.perceive import DetectObject, EstimatePose
from behaviours.place import FindPlacePose, PlaceOn, Release
from behaviours.stand import FindStandPose
from bestman_bt.engine import Fallback, Node, ReactiveSequence, RetryUntilSuccessful, Sequence, SubTree


def build() -> Node:
    """Fetch an object from one surface and place it on another, at a goal in the map frame."""
    have_object = Fallback(
        "have_object",
        [
            Holding(object="{object}"),
            SubTree(pick, tree_id="Pick", name="pick", object="{object}", surface="{source}"),
        ],
    )
    pick_and_place = Sequence(
        "pick_and_place",
        [
            have_object,
            SubTree(place, tree_id="Place", name="place", object="{object}", surface="{target}", goal="{goal}"),
            SubTree(verify, tree_id="Verify", name="verify", object="{object}", surface="{target}", goal="{goal}"),
        ],
    )
    return RetryUntilSuccessful("fetch", [pick_and_place], num_attempts=3)


def pick() -> Node:
    """Take the object: another stand pose, another look, another grasp where one fails."""
    look_and_grasp = Sequence(
        "look_and_grasp",
        [
            MoveArm(posture="carry"),
            LookAt(object="{object}", surface="{where}"),
            DetectObject(object="{object}", surface="{where}"),
            Reachable(object="{object}"),
            LookAt(object="{object}", surface="{where}"),
            EstimatePose(object="{object}", pose="{pose}"),
            PlanGrasp(object="{object}", grasps="{grasps}"),
            RetryUntilSuccessful("try_grasps", [Grasp(object="{object}", grasps="{grasps}")], num_attempts=3),
        ],
    )
    from_one_stand = Sequence(
        "from_one_stand",
        [
            BelievedSurface(object="{object}", otherwise="{surface}", surface="{where}"),
            FindStandPose(object="{object}", surface="{where}", stand="{stand}"),
            MoveArm(posture="carry"),
            NavigateTo(goal="{stand}"),
            RetryUntilSuccessful("try_looks", [look_and_grasp], num_attempts=2),
        ],
    )
    try_stands = RetryUntilSuccessful("try_stands", [from_one_stand], num_attempts=2)
    return Sequence("pick", [try_stands, Retreat(posture="carry")])


def place() -> Node:
    """Carry the object to the surface and put it at the goal."""
    carry = ReactiveSequence("carry", [Holding(object="{object}"), NavigateTo(goal="{stand}")])
    from_one_stand = Sequence(
        "from_one_stand",
        [
            FindStandPose(surface="{surface}", goal="{goal}", stand="{stand}"),
            MoveArm(posture="carry"),
            carry,
            LookAt(surface="{surface}", point="{goal}"),
            FindPlacePose(object="{object}", surface="{surface}", goal="{goal}", pose="{place_pose}"),
            PlaceOn(object="{object}", pose="{place_pose}"),
            Release(object="{object}", surface="{surface}"),
            Retreat(posture="carry"),
        ],
    )
    return RetryUntilSuccessful("try_stands", [from_one_stand], num_attempts=2)


def verify() -> Node:
    """Look whether the object stands where it should."""
    look = Sequence(
        "look",
        [
            LookAt(surface="{surface}", point="{goal}"),
            DetectObject(object="{object}", surface="{surface}"),
        ],
    )
    return Sequence(
        "verify",
        [
            RetryUntilSuccessful("try_looks", [look], num_attempts=2),
            ObjectAt(object="{object}", goal="{goal}", tolerance=0.015),
        ],
    )
