"""Skills declare the codes that they fail with, all of them and no others, with advice that names leaves that exist."""

from __future__ import annotations

import re

import pytest

from behaviours.arm_motion import ARM_PLANNING_FAILS
from behaviours.failure import MOTION_FAILS, SEEING_FAILS, declared_failures, own_failures
from behaviours.furniture.articulation_motion import FOLLOWING_FAILS, error_code
from behaviours.navigation.navigate import DRIVING_FAILS
from behaviours.skill import ErrorReporting, Skill
from bestman_bt.control.arm.constraint_following import FollowEnd
from bestman_bt.control.rgbd import CameraErrorCode
from bestman_bt.manipulation.motion_planning.base import PlanningErrorCode
from bestman_bt.manipulation.policy import errors as policy_errors
from bestman_bt.messages import MotionErrorCode
from bestman_bt.navigation.global_planning.base import PlanningFailureReason
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.registry import BEHAVIOURS
from tests.behaviours.raised_codes import raised_codes

LEAVES = {name: found for name in BEHAVIOURS if issubclass(found := BEHAVIOURS.resolve(name), ErrorReporting)}
LEAF = re.compile(r"\b[A-Z][a-z]+(?:[A-Z][a-z]+)+\b")
SYNONYMS = {"hand_full", "object_not_found", "not_seen", "time_limit"}
OF_ENUMERATIONS = {
    *ARM_PLANNING_FAILS,
    *DRIVING_FAILS,
    *FOLLOWING_FAILS,
    *(kind.code for kind in vars(policy_errors).values() if isinstance(kind, type) and hasattr(kind, "code")),
    NoSurfaceError.code,
    "collision",  # of an approach that met something
    *("not_open", "timeout"),  # of a following that got to its end, or not
}
"""Codes that stand in no skill as literals."""


@pytest.mark.parametrize("name", sorted(LEAVES))
def test_every_code_that_a_skill_fails_with_is_declared_and_only_those(name: str) -> None:
    raised = raised_codes(LEAVES[name])
    assert raised <= set(declared_failures(LEAVES[name]))
    assert set(own_failures(LEAVES[name])) <= raised | OF_ENUMERATIONS


def test_the_codes_of_motions_cameras_and_planners_are_declared_where_they_are_reported() -> None:
    assert set(MOTION_FAILS) == set(MotionErrorCode)
    assert set(SEEING_FAILS) == set(CameraErrorCode)
    assert {*ARM_PLANNING_FAILS, "timeout"} == set(PlanningErrorCode)
    assert set(DRIVING_FAILS) == {reason.value for reason in PlanningFailureReason}
    assert {*FOLLOWING_FAILS, "timeout"} == {error_code(end) for end in FollowEnd} - {""}
    assert set(MOTION_FAILS) | set(SEEING_FAILS) < set(declared_failures(Skill))


def test_advice_names_leaves_that_exist_and_no_code_has_a_synonym() -> None:
    for name, leaf in LEAVES.items():
        for code, advice in declared_failures(leaf).items():
            assert advice, f"{name} {code}"
            assert set(LEAF.findall(advice)) <= set(BEHAVIOURS), f"{name} {code}: {advice}"
            assert code not in SYNONYMS


def test_the_more_special_advice_counts() -> None:
    assert declared_failures(LEAVES["Grasp"])["no_path"] == "Grasp again: the next planned grasp"
    assert declared_failures(LEAVES["PlaceIn"])["not_holding"] == declared_failures(LEAVES["PlaceOn"])["not_holding"]


@pytest.mark.parametrize("name", sorted({"Grasp", "PlaceOn", "PlaceIn", "Push", "Open", "Close"}))
def test_skills_that_act_on_things_report_what_they_need_and_bring_about(name: str) -> None:
    declared = LEAVES[name].DECLARATION  # type: ignore[attr-defined]  # these are skills, LEAVES holds nodes
    assert declared.pre
    assert declared.effects
