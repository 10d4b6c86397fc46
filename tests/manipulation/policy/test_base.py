"""Observations, chunks and specifications refuse what cannot be meant."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.policy.base import ActionChunk, Observation
from bestman_bt.manipulation.policy.errors import PolicyActionError, PolicyModelError, PolicyObservationError
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.messages import Pose

SPECIFICATION = PolicySpecification(
    joint_names=("a", "b"),
    space="joint_deltas",
    horizon=4,
    dt=0.1,
    robot="two_joints",
    images={"head": (48, 64)},
    workspace=((0.0, -0.5, 0.2), (0.6, 0.5, 0.9)),
)


def test_a_specification_goes_through_json_unchanged() -> None:
    assert PolicySpecification.from_json(SPECIFICATION.to_json()) == SPECIFICATION


@pytest.mark.parametrize("text", ["", "[]", "{}", SPECIFICATION.to_json().replace('"dt": 0.1', '"dt": "fast"')])
def test_what_is_no_specification_is_refused(text: str) -> None:
    with pytest.raises(PolicyModelError, match="not a policy specification"):
        PolicySpecification.from_json(text)


@pytest.mark.parametrize(
    ("actions", "dt", "space", "told"),
    [
        (np.zeros(7), 0.1, ActionSpace.JOINT_DELTAS, r"shape \(H, n\)"),
        (np.zeros((0, 7)), 0.1, ActionSpace.JOINT_DELTAS, r"shape \(H, n\)"),
        (np.full((2, 7), np.nan), 0.1, ActionSpace.JOINT_DELTAS, "NaN"),
        (np.full((2, 7), np.inf), 0.1, ActionSpace.JOINT_POSITIONS, "infinity"),
        (np.zeros((2, 7)), 0.0, ActionSpace.JOINT_DELTAS, "dt should be above 0"),
        (np.zeros((2, 7)), 0.1, ActionSpace.TOOL_TWIST, "6 columns"),
    ],
)
def test_a_chunk_that_cannot_be_carried_out_is_refused(
    actions: np.ndarray, dt: float, space: ActionSpace, told: str
) -> None:
    with pytest.raises(PolicyActionError, match=told):
        ActionChunk(actions, dt, space)


def test_an_observation_with_nan_or_a_picture_of_another_kind_is_refused() -> None:
    with pytest.raises(PolicyObservationError, match="joint_positions"):
        Observation(np.array([0.0, np.nan]), Pose())
    with pytest.raises(PolicyObservationError, match="'head'"):
        Observation(np.zeros(2), Pose(), images={"head": np.zeros((4, 4, 3))})


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"dt": 0.0}, "dt should be a finite number above 0, got 0.0"),
        ({"dt": float("nan")}, "dt should be"),
        ({"executed": -5}, "executed should be a whole number"),
        ({"goal_size": "seven"}, "goal_size should be a whole number"),
        ({"workspace": ((1.0, 0.0, 0.0), (0.0, 1.0, 1.0))}, "a lower and an upper corner"),
        ({"joint_names": "panda"}, "joint_names should be a list, got 'panda'"),
    ],
)
def test_a_specification_that_no_policy_can_have_is_refused(wrong: dict[str, object], told: str) -> None:
    with pytest.raises(PolicyModelError, match=told):
        PolicySpecification.from_dict(SPECIFICATION.to_dict() | wrong)
