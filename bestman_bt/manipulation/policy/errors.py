"""What learned policies raise; ``code`` is what a skill reports."""

from __future__ import annotations

from bestman_bt.manipulation.errors import ManipulationError


class PolicyError(ManipulationError):
    """A policy that cannot be used, or an answer of it that cannot be carried out."""

    code = "policy_failed"


class PolicyModelError(PolicyError):
    """No such policy, no such format, or other inputs and outputs than its specification says."""

    code = "policy_unusable"


class PolicyObservationError(PolicyError):
    """The observation lacks what the policy needs, or has another shape."""

    code = "bad_observation"


class PolicyActionError(PolicyError):
    """The policy answered with NaN, infinity or another shape than its specification says."""

    code = "bad_action"


class StaleChunkError(PolicyError):
    """A chunk came so late that the arm is no longer where it goes on from; ask again."""

    code = "stale_chunk"


class PolicyUnreachableError(PolicyError):
    """A policy server gave no answer in time; the message has the address and the reason."""

    code = "policy_unreachable"


class PolicyServerError(PolicyError):
    """A policy server answered with an error, or with something that breaks the protocol."""

    code = "policy_server"
