"""Learned policies by name: shipped ones, or a user's file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from behaviours.run_policy import RunPolicy
from bestman_bt.configuration import ConfigurationError, Problem, beside, find_data
from bestman_bt.engine import Tree
from bestman_bt.manipulation.policy import Policy, PolicyError, PolicyModelError, load_policy
from bestman_bt.runtime.tree_checks import literals


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
    """Policies that a tree names in its ``file`` and that are not there, or whose description is wrong.

    One that a SubTree is given is told in the SubTree's line.
    """
    told: set[tuple[int, str]] = set()
    for node in tree.nodes:
        if not isinstance(node, RunPolicy) or "policy" not in node.attributes:
            continue
        for place, port, name in literals(node, "policy", tree):
            try:
                _ = find_policy(name, file).specification
            except PolicyError as error:
                source = str(file) if place.place is None else place.place.file
                if (place.uid, port) not in told:
                    told.add((place.uid, port))
                    yield Problem(source, place.line or None, port, str(error))
