"""Lookup of learned policies: shipped ones, or a user's file or class."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from behaviours.manipulation.policy import RunPolicy
from bestman_bt.configuration.data import find_data, in_folders
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.errors import Problem as WrongInput
from bestman_bt.engine import Tree
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.unwritten import problem_at
from bestman_bt.errors import MissingExtraError, WrongResultError
from bestman_bt.manipulation.policy.base import Policy
from bestman_bt.manipulation.policy.errors import PolicyError, PolicyModelError
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.runtime.algorithms import class_at, made_of_own, message_for_tree, refuse_unfinished
from bestman_bt.runtime.tree_checks import literals


def find_policy(name: str, folders: Iterable[Path] = ()) -> Policy:
    """Return the policy of a shipped name, an .onnx or .yaml file, or the class ``file.py:Class``.

    ``folders``: searched first for a file. Raises PolicyModelError suggesting the closest name.
    """
    if ":" in name:
        return _own_policy(name, tuple(folders))
    try:
        path = find_data("policy", in_folders(name, folders))
    except ConfigurationError as error:
        raise PolicyModelError(error.problems[0].message) from error
    return load_policy(path)


def _own_policy(name: str, folders: tuple[Path, ...]) -> Policy:
    try:
        made_by = class_at(name, folders, lambda message: WrongInput(name, None, "", message))
        refuse_unfinished(made_by, Policy, "")
        policy: Policy = made_of_own(made_by, Policy, "")
    except ConfigurationError as error:
        raise PolicyModelError(message_for_tree(error)) from error
    return policy


def policy_problems(tree: Tree) -> Iterator[TreeProblem]:
    """Yield the policies that a tree names but that are missing or invalid, each with its line in the tree."""
    reported: set[tuple[int, str]] = set()
    for node in tree.nodes:
        if not isinstance(node, RunPolicy) or "policy" not in node.attributes:
            continue
        for place, port, name in literals(node, "policy", tree):
            try:
                _ = find_policy(name, node.folders).specification
            except (PolicyError, MissingExtraError, WrongResultError) as error:
                if (place.uid, port) not in reported:
                    reported.add((place.uid, port))
                    yield problem_at(place, port, str(error), "")
