"""Learning-based manipulation: policies that give action chunks, where they come from, what they learn from."""

from bestman_bt.manipulation.policy.base import ActionChunk, ActionSpace, Observation, Policy
from bestman_bt.manipulation.policy.behaviour_cloning import BehaviourCloningParameters, ClonedPolicy, clone
from bestman_bt.manipulation.policy.chunk_path import chunk_path
from bestman_bt.manipulation.policy.chunk_trajectory import chunk_trajectory
from bestman_bt.manipulation.policy.demonstrations import DatasetError, DemonstrationFormat, DemonstrationRecorder
from bestman_bt.manipulation.policy.errors import (
    MissingPolicyExtraError,
    PolicyActionError,
    PolicyError,
    PolicyModelError,
    PolicyObservationError,
    PolicyServerError,
    PolicyUnreachableError,
)
from bestman_bt.manipulation.policy.features import feature_vector, pose_error, pose_vector
from bestman_bt.manipulation.policy.load import load_policy
from bestman_bt.manipulation.policy.onnx_policy import (
    OnnxPolicy,
    OnnxPolicyParameters,
    PolicyCard,
    PolicyNormalization,
)
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy, OpenpiPolicyParameters
from bestman_bt.manipulation.policy.reaching import Demonstration, ReachingExpert, ReachingParameters
from bestman_bt.manipulation.policy.rollout import Rollout, roll_out
from bestman_bt.manipulation.policy.specification import PolicySpecification
from bestman_bt.manipulation.policy.workspace import Workspace

__all__ = [
    "ActionChunk",
    "ActionSpace",
    "BehaviourCloningParameters",
    "ClonedPolicy",
    "DatasetError",
    "Demonstration",
    "DemonstrationFormat",
    "DemonstrationRecorder",
    "MissingPolicyExtraError",
    "Observation",
    "OnnxPolicy",
    "OnnxPolicyParameters",
    "OpenpiPolicy",
    "OpenpiPolicyParameters",
    "Policy",
    "PolicyActionError",
    "PolicyCard",
    "PolicyError",
    "PolicyModelError",
    "PolicyNormalization",
    "PolicyObservationError",
    "PolicyServerError",
    "PolicySpecification",
    "PolicyUnreachableError",
    "ReachingExpert",
    "ReachingParameters",
    "Rollout",
    "Workspace",
    "chunk_path",
    "chunk_trajectory",
    "clone",
    "feature_vector",
    "load_policy",
    "pose_error",
    "pose_vector",
    "roll_out",
]
