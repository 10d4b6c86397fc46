"""Errors of learned policies; ``code``: for skills."""

from __future__ import annotations

from bestman_bt.manipulation.errors import ManipulationError


class PolicyError(ManipulationError):
    """A policy cannot be used, or its answer cannot be executed."""

    code = "policy_failed"


class PolicyModelError(PolicyError):
    """Unknown policy or format, or inputs and outputs that differ from the specification."""

    code = "policy_unusable"


class PolicyObservationError(PolicyError):
    """The observation lacks a field that the policy needs, or a field has the wrong shape."""

    code = "bad_observation"


class PolicyActionError(PolicyError):
    """The policy returned NaN, infinity or a shape that differs from its specification."""

    code = "bad_action"


class StaleChunkError(PolicyError):
    """A chunk arrived too late to continue the motion; query again."""

    code = "stale_chunk"


class PolicyUnreachableError(PolicyError):
    """A policy server gave no answer in time; the message has the address and the reason."""

    code = "policy_unreachable"


class PolicyServerError(PolicyError):
    """A policy server answered with an error, or violated the protocol."""

    code = "policy_server"
