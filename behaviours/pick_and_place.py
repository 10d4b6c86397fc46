"""Subtrees for trees in Python, identical to trees/subtrees/pick_and_place.xml node by node.

``SubTree(pick_and_place, tree_id="PickAndPlace", object="{object}", source="table", target="counter", goal="{goal}")``
"""

from __future__ import annotations

from behaviours.clear_stop import ClearStop
from behaviours.manipulation.base_placement import FindStandPose
from behaviours.manipulation.grasp import Grasp, Holding, PlanGrasp, Reachable
from behaviours.manipulation.move_arm import MoveArm, Retreat
from behaviours.manipulation.next_best_view import SecondLook
from behaviours.manipulation.place import FindPlacePose, PlaceOn, Release
from behaviours.navigation.navigate import NavigateTo
from behaviours.perception.look import LookAt
from behaviours.perception.perceive import BelievedSurface, DetectObject, EstimatePose, ObjectAt
from behaviours.perception.scan import ScanScene
from behaviours.perception.tidying import FindFreePlace
from bestman_bt.engine import Fallback, ForceSuccess, Node, ReactiveSequence, RetryUntilSuccessful, Sequence, SubTree


def pick_and_place() -> Node:
    """Bring an object to a goal and verify its pose; start over if it is lost on the way or misplaced."""
    bring = Sequence(
        "bring",
        [
            ClearStop(),
            have_object(),
            SubTree(
                place, tree_id="Place", name="place", object="{object}", surface="{target}", goal="{goal}", arm="{arm}"
            ),
            SubTree(verify, tree_id="Verify", name="verify", object="{object}", surface="{target}", goal="{goal}"),
        ],
    )
    return RetryUntilSuccessful("pick_and_place", [bring], num_attempts=3)


def have_object() -> Node:
    """Pick the object unless the hand holds it."""
    taken = SubTree(pick, tree_id="Pick", name="pick", object="{object}", surface="{source}", arm="{arm}")
    return Fallback("have_object", [Holding(object="{object}", arm="{arm}"), taken])


def pick() -> Node:
    """Pick the object; after a failure, retry with another grasp, another look, another base placement."""
    look_and_grasp = Sequence(
        "look_and_grasp",
        [
            MoveArm(posture="carry", arm="{arm}"),
            LookAt(object="{object}", surface="{where}"),
            DetectObject(object="{object}", surface="{where}"),
            Reachable(object="{object}", arm="{arm}"),
            LookAt(object="{object}", surface="{where}"),
            EstimatePose(object="{object}", pose="{pose}"),
            ForceSuccess("if_it_can", [SecondLook(object="{object}", max_yaw_width=0.2, arm="{arm}")]),
            PlanGrasp(object="{object}", grasps="{grasps}", arm="{arm}", approach="{approach}"),
            RetryUntilSuccessful(
                "try_grasps", [Grasp(object="{object}", grasps="{grasps}", arm="{arm}")], num_attempts=3
            ),
        ],
    )
    from_one_stand = Sequence(
        "from_one_stand",
        [
            BelievedSurface(object="{object}", otherwise="{surface}", surface="{where}"),
            FindStandPose(
                object="{object}",
                surface="{where}",
                stand="{stand}",
                error_code="{stand_error}",
                arm="{arm}",
                approach="{approach}",
            ),
            MoveArm(posture="carry", arm="{arm}"),
            NavigateTo(goal="{stand}"),
            RetryUntilSuccessful("try_looks", [look_and_grasp], num_attempts=2),
        ],
    )
    try_stands = RetryUntilSuccessful("try_stands", [from_one_stand], num_attempts=2)
    return Sequence("pick", [try_stands, Retreat(posture="carry", arm="{arm}")])


def carry() -> Node:
    """Drive while the hand holds the object."""
    return ReactiveSequence("carry", [Holding(object="{object}", arm="{arm}"), NavigateTo(goal="{stand}")])


def place() -> Node:
    """Carry the object to the surface and place it at the goal."""
    from_one_stand = Sequence(
        "from_one_stand",
        [
            FindStandPose(surface="{surface}", goal="{goal}", stand="{stand}", arm="{arm}"),
            MoveArm(posture="carry", arm="{arm}"),
            carry(),
            putting_down(),
        ],
    )
    return RetryUntilSuccessful("try_stands", [from_one_stand], num_attempts=2)


def putting_down() -> Node:
    """Return the subtree ``put_down`` with the entries of the same names."""
    same = {key: f"{{{key}}}" for key in ("object", "surface", "goal", "arm")}
    return SubTree(put_down, tree_id="PutDown", name="put_down", **same)


def put_down() -> Node:
    """Place the held object at the goal from the current base pose."""
    past_the_arm = Sequence(
        "past_the_arm",
        [MoveArm(posture="carry", sight="{goal}", arm="{arm}"), *see_the_place()],  # which may have hidden it
    )
    return Sequence(
        "put_down",
        [
            Fallback("see_the_place", [Sequence("as_it_is_carried", see_the_place()), past_the_arm]),
            PlaceOn(object="{object}", pose="{place_pose}", arm="{arm}"),
            RetryUntilSuccessful(
                "let_go", [Release(object="{object}", surface="{surface}", arm="{arm}")], num_attempts=3
            ),
            Retreat(posture="carry", arm="{arm}"),
        ],
    )


def see_the_place() -> list[Node]:
    """Return the nodes that look at the goal and measure the pose there."""
    return [
        LookAt(surface="{surface}", point="{goal}"),
        FindPlacePose(object="{object}", surface="{surface}", goal="{goal}", pose="{place_pose}"),
    ]


def put_aside() -> Node:
    """Place an object that could not be placed at its goal anywhere free on the surface, to empty the hand."""
    at_a_free_place = Sequence(
        "at_a_free_place",
        [
            FindStandPose(surface="{surface}", stand="{stand}", error_code="{stand_error}", arm="{arm}"),
            MoveArm(posture="carry", arm="{arm}"),
            carry(),
            LookAt(surface="{surface}"),
            FindFreePlace(object="{object}", surface="{surface}", goal="{goal}"),
            putting_down(),
        ],
    )
    try_places = RetryUntilSuccessful("try_places", [at_a_free_place], num_attempts=3)
    return Sequence("put_aside", [Holding(object="{object}", arm="{arm}"), try_places])


def verify() -> Node:
    """Check by a look whether the object is at its goal."""
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


def survey() -> Node:
    """Stand in front of a surface and add all objects seen on it to the belief."""
    return RetryUntilSuccessful(
        "try_stands",
        [
            Sequence(
                "survey",
                [
                    ClearStop(),
                    FindStandPose(surface="{surface}", stand="{stand}", error_code="{stand_error}", arm="{arm}"),
                    MoveArm(posture="carry", arm="{arm}"),
                    NavigateTo(goal="{stand}"),
                    ScanScene(surface="{surface}", views=3),
                ],
            )
        ],
        num_attempts=2,
    )
