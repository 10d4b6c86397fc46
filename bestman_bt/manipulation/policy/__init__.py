"""Learning-based manipulation: policies that give action chunks, and the motion that they make."""

from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.chunk_stream import ChunkStream, StreamedMotion, chunk_path
from bestman_bt.manipulation.policy.errors import (
    PolicyActionError,
    PolicyError,
    PolicyModelError,
    PolicyObservationError,
    PolicyServerError,
    PolicyUnreachableError,
    StaleChunkError,
)
from bestman_bt.manipulation.policy.features import feature_vector, pose_error, pose_vector
from bestman_bt.manipulation.policy.onnx_policy import (
    OnnxPolicy,
    PolicyCard,
    PolicyNormalization,
)
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification, Workspace

__all__ = [
    "ActionChunk",
    "ActionSpace",
    "ChunkStream",
    "Observation",
    "OnnxPolicy",
    "OpenpiPolicy",
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
    "StaleChunkError",
    "StreamedMotion",
    "Workspace",
    "chunk_path",
    "feature_vector",
    "load_policy",
    "pose_error",
    "pose_vector",
]
