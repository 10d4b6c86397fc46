"""Controls of learned policies: one that does nothing, and one that is told a wrong goal. Neither shall succeed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.skill import ErrorReporting
from bestman_bt.engine import SyncAction
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification

ASIDE = 0.10
"""Metres by which a wrong goal stands beside the right one, towards the middle."""


class Altered(Policy):
    """Another policy, of which what it sees and what it says can be changed."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy

    @property
    def specification(self) -> PolicySpecification:
        """That of the other one."""
        return self.policy.specification

    def reset(self) -> None:
        """Begin anew."""
        self.policy.reset()

    def act(self, observation: Observation) -> ActionChunk:
        """As the other one."""
        return self.policy.act(observation)

    def close(self) -> None:
        """Let go of what it holds."""
        self.policy.close()


class Null(Altered):
    """Does nothing."""

    def act(self, observation: Observation) -> ActionChunk:
        """Joint deltas of zero."""
        spec = self.specification
        return ActionChunk(np.zeros((spec.horizon, len(spec.joint_names))), spec.dt, ActionSpace(spec.space))


class WrongGoal(Altered):
    """Told another place."""

    def act(self, observation: Observation) -> ActionChunk:
        """As the other one would act there."""
        shift = np.zeros_like(observation.goal)
        shift[1] = -ASIDE if observation.goal[1] > 0.0 else ASIDE
        return super().act(replace(observation, goal=observation.goal + shift))


ALTERATIONS: dict[str, Callable[[Policy], Policy]] = {"null": Null, "wrong_goal": WrongGoal}


class AlterPolicies(ErrorReporting, SyncAction):
    """From now on all policies of the robot are altered."""

    INPUT_PORTS: ClassVar = {"how": PortInformation(str, description="null or wrong_goal")}

    def on_tick(self) -> int:
        """Wrap what finds them."""
        find, alter = self.skills.policies, ALTERATIONS[self.get_input("how")]
        self.skills.policies = lambda name, folders: alter(find(name, folders))
        return self.succeed()
