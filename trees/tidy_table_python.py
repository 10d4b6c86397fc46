"""The tree of tidy_table.xml, written in Python: the same nodes, the same behaviour.

bestman-bt run tidy_table_python --task tidy_table
"""

from __future__ import annotations

from behaviours.clear_stop import ClearStop
from behaviours.manipulation.base_placement import FindStandPose
from behaviours.manipulation.move_arm import MoveArm
from behaviours.perception.look import LookAt
from behaviours.perception.tidying import FindFreePlace, FindUntidy, IsTidy, RememberSeen
from behaviours.pick_and_place import carry, have_object, place, put_aside, put_down, survey, verify
from bestman_bt.engine import Fallback, ForceSuccess, ForEach, Node, RetryUntilSuccessful, Sequence, SubTree

REGION = {"region_x": "{region_x}", "region_y": "{region_y}"}
AT_GOAL = {"object": "{object}", "surface": "{target}", "goal": "{goal}"}


def build() -> Node:
    """Put what is seen on a surface away into a region of another one; what goes wrong is tried again later."""
    put_one_away = SubTree(
        put_away, tree_id="PutAway", name="put_away", object="{object}", source="{source}", target="{target}", **REGION
    )
    aside = SubTree(put_aside, tree_id="PutAside", name="put_aside", object="{object}", surface="{source}")
    go_on = ForceSuccess("go_on_with_the_others", [Fallback("away_or_aside", [put_one_away, aside])])
    a_round = Sequence(
        "round",
        [
            RememberSeen(objects="{objects}", seen="{seen}"),
            FindUntidy(seen="{seen}", surface="{target}", untidy="{untidy}", **REGION),
            ForEach("each", [go_on], items="{untidy}", item="{object}"),
            SubTree(survey, tree_id="Survey", name="survey_target", surface="{target}"),
            SubTree(survey, tree_id="Survey", name="survey_source", surface="{source}"),
            RememberSeen(objects="{objects}", seen="{seen}"),
            IsTidy(seen="{seen}", surface="{target}", **REGION),
        ],
    )
    return Sequence(
        "tidy_table",
        [
            SubTree(survey, tree_id="Survey", name="survey", surface="{source}"),
            RetryUntilSuccessful("rounds", [a_round], num_attempts=4),
        ],
    )


def put_away() -> Node:
    """Take one thing to a free place; another place where that fails."""
    choose_place = Sequence(
        "choose_place",
        [
            FindStandPose(surface="{target}", stand="{stand}"),
            MoveArm(posture="carry"),
            carry(),
            LookAt(surface="{target}"),
            FindFreePlace(object="{object}", surface="{target}", goal="{goal}", **REGION),
        ],
    )
    from_here_or_elsewhere = Fallback(
        "from_here_or_elsewhere",
        [
            SubTree(put_down, tree_id="PutDown", name="put_down", **AT_GOAL),
            SubTree(place, tree_id="Place", name="place", **AT_GOAL),
        ],
    )
    put_one_away = Sequence(
        "put_away",
        [
            ClearStop(),
            have_object(),
            choose_place,
            from_here_or_elsewhere,
            SubTree(verify, tree_id="Verify", name="verify", **AT_GOAL),
        ],
    )
    return RetryUntilSuccessful("try_places", [put_one_away], num_attempts=3)
