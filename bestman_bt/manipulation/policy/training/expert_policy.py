"""The picking expert as a policy, to demonstrate in a physics simulation."""

from __future__ import annotations

import numpy as np

from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyObservationError
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.manipulation.policy.training.picking import PickingExpert, PickState
from bestman_bt.messages import Pose


class ExpertPolicy(Policy):
    """Plans its actions from the observations that a learned policy gets."""

    def __init__(self, expert: PickingExpert, robot: str) -> None:
        self._expert, self._specification = expert, expert.specification(robot)

    @property
    def specification(self) -> PolicySpecification:
        """The specification of the policy to be trained."""
        return self._specification

    def reset(self) -> None:
        """Do nothing: the policy is stateless."""

    def act(self, observation: Observation) -> ActionChunk:
        """Return a planned chunk. Raises PolicyObservationError without velocities, gripper width or a pose as goal."""
        velocities, width, goal = observation.joint_velocities, observation.gripper_width, observation.goal
        if velocities is None or width is None or goal.shape != (7,):
            raise PolicyObservationError("the expert needs velocities, the gripper's width and a pose as goal")
        state = PickState(observation.joint_positions, velocities, np.zeros(len(velocities)), width)
        deltas, gripper = self._expert.plan(state, Pose(goal[:3], goal[3:]))
        widths = np.where(gripper > 0.0, self._specification.open_width, 0.0)
        return ActionChunk(deltas, self._specification.dt, ActionSpace.JOINT_DELTAS, widths)
