"""Training of policies: who demonstrates, how demonstrations are kept, and what learns from them."""

from bestman_bt.manipulation.policy.training.behaviour_cloning import BehaviourCloning, ClonedPolicy
from bestman_bt.manipulation.policy.training.demonstrations import (
    DatasetError,
    Demonstration,
    DemonstrationFormat,
    DemonstrationRecorder,
)
from bestman_bt.manipulation.policy.training.expert_policy import ExpertPolicy
from bestman_bt.manipulation.policy.training.picking import PICKING_FEATURES, PickedObject, PickingExpert, PickState
from bestman_bt.manipulation.policy.training.reaching import REACHING_FEATURES, ReachingExpert
from bestman_bt.manipulation.policy.training.rollout import Rollout, roll_out

__all__ = [
    "PICKING_FEATURES",
    "REACHING_FEATURES",
    "BehaviourCloning",
    "ClonedPolicy",
    "DatasetError",
    "Demonstration",
    "DemonstrationFormat",
    "DemonstrationRecorder",
    "ExpertPolicy",
    "PickState",
    "PickedObject",
    "PickingExpert",
    "ReachingExpert",
    "Rollout",
    "roll_out",
]
