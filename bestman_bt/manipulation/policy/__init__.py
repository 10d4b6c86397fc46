"""Learning-based manipulation: policies that give action chunks, where they come from, what they learn from."""

from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.behaviour_cloning import BehaviourCloning, ClonedPolicy
from bestman_bt.manipulation.policy.chunk_stream import ChunkStream, StreamedMotion, chunk_path
from bestman_bt.manipulation.policy.demonstrations import (
    DatasetError,
    Demonstration,
    DemonstrationFormat,
    DemonstrationRecorder,
)
from bestman_bt.manipulation.policy.errors import (
    PolicyActionError,
    PolicyError,
    PolicyModelError,
    PolicyObservationError,
    PolicyServerError,
    PolicyUnreachableError,
    StaleChunkError,
)
from bestman_bt.manipulation.policy.expert_policy import ExpertPolicy
from bestman_bt.manipulation.policy.features import feature_vector, pose_error, pose_vector
from bestman_bt.manipulation.policy.onnx_policy import (
    OnnxPolicy,
    PolicyCard,
    PolicyNormalization,
)
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy
from bestman_bt.manipulation.policy.picking import (
    PICKING_FEATURES,
    PickedObject,
    PickingExpert,
    PickState,
)
from bestman_bt.manipulation.policy.reaching import REACHING_FEATURES, ReachingExpert
from bestman_bt.manipulation.policy.rollout import Rollout, load_policy, roll_out
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification, Workspace

__all__ = [
    "PICKING_FEATURES",
    "REACHING_FEATURES",
    "ActionChunk",
    "ActionSpace",
    "BehaviourCloning",
    "ChunkStream",
    "ClonedPolicy",
    "DatasetError",
    "Demonstration",
    "DemonstrationFormat",
    "DemonstrationRecorder",
    "ExpertPolicy",
    "Observation",
    "OnnxPolicy",
    "OpenpiPolicy",
    "PickState",
    "PickedObject",
    "PickingExpert",
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
    "Rollout",
    "StaleChunkError",
    "StreamedMotion",
    "Workspace",
    "chunk_path",
    "feature_vector",
    "load_policy",
    "pose_error",
    "pose_vector",
    "roll_out",
]
