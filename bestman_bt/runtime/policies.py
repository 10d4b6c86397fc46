"""Learned policies by name: shipped ones, or a user's file."""

from __future__ import annotations

from bestman_bt.configuration import ConfigurationError, find_data
from bestman_bt.manipulation.policy import Policy, PolicyModelError, load_policy


def find_policy(name: str) -> Policy:
    """The policy of a bare name (a shipped one), an .onnx or a .yaml file; PolicyModelError suggests the closest."""
    try:
        path = find_data("policy", name)
    except ConfigurationError as error:
        raise PolicyModelError(error.problems[0].message) from error
    return load_policy(path)
