"""Learned policies by name: shipped ones, or a user's file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from behaviours.run_policy import RunPolicy
from bestman_bt.configuration import ConfigurationError, Problem, beside, find_data
from bestman_bt.engine import Tree
from bestman_bt.engine.ports import key_of
from bestman_bt.manipulation.policy import Policy, PolicyError, PolicyModelError, load_policy


def find_policy(name: str, tree: Path | None = None) -> Policy:
    """The policy of a bare name (a shipped one), an .onnx or a .yaml file; PolicyModelError suggests the closest.

    ``tree``: the file that names it, from whose folder a path is counted.
    """
    try:
        path = find_data("policy", name if tree is None else beside(tree, "policy", name))
    except ConfigurationError as error:
        raise PolicyModelError(error.problems[0].message) from error
    return load_policy(path)


def policy_problems(tree: Tree, file: Path) -> Iterator[Problem]:
    """Policies that the leaves of a tree name in its ``file`` and that are not there, or whose description is wrong."""
    for node in tree.nodes:
        name = node.attributes.get("policy")
        if not isinstance(node, RunPolicy) or not isinstance(name, str) or key_of(name, "policy") is not None:
            continue
        try:
            _ = find_policy(name, file).specification
        except PolicyError as error:
            source = str(file) if node.place is None else node.place.file
            yield Problem(source, node.line or None, "policy", str(error))
