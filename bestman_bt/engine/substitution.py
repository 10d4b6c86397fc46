"""Substitution rules: replace nodes of a loaded tree, to test the tree without its robot.

A rule's filter is a node's name, its type, or a wildcard over its path (``arm/*``); the first match applies.
"""

from __future__ import annotations

import fnmatch
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.errors import EngineError, ScriptError
from bestman_bt.engine.leaves.script import TestNode, TestNodeConfig
from bestman_bt.engine.status import STATUS_NAMES
from bestman_bt.errors import InputError

if TYPE_CHECKING:
    from bestman_bt.engine.core.registry import NodeInfo
    from bestman_bt.engine.core.tree import Tree


class SubstitutionError(EngineError, InputError):
    """Raised if substitution rules are invalid, or name a node that is not registered."""


@dataclass
class SubstitutionRules:
    """Filters → the replacement of the matching nodes: a registered name, or a TestNode; ``file``: where they are from,
    for messages.
    """

    rules: dict[str, str | TestNodeConfig] = field(default_factory=dict)
    file: str = ""

    def add(self, pattern: str, replacement: str | TestNodeConfig) -> SubstitutionRules:
        """Replace the nodes that match ``pattern``; returns the rules, for chaining."""
        self.rules[pattern] = replacement
        return self

    @classmethod
    def from_json(cls, text: str | Mapping[str, Any]) -> SubstitutionRules:
        """Read the format of BehaviorTree.CPP: ``{"TestNodeConfigs": {...}, "SubstitutionRules": {...}}``.

        Raises:
            SubstitutionError: a field is missing, unknown or of the wrong type, or a script is invalid.
        """
        try:
            data = json.loads(text) if isinstance(text, str) else text
        except ValueError as error:
            raise SubstitutionError(f"the rules are not JSON: {error}") from error
        if not isinstance(data, Mapping) or not isinstance(data.get("SubstitutionRules"), Mapping):
            raise SubstitutionError("the rules must be an object with the field 'SubstitutionRules'")
        given = data.get("TestNodeConfigs", {})
        if not isinstance(given, Mapping):
            raise SubstitutionError(f"TestNodeConfigs must be an object but is {given!r:.60}")
        configs = {str(name): _config(name, value) for name, value in given.items()}
        rules = {str(pattern): value for pattern, value in data["SubstitutionRules"].items()}
        for pattern, value in rules.items():
            if not isinstance(value, str):
                what = f"should be the name of a node or of a TestNodeConfig, got {value!r:.60}"
                raise SubstitutionError(f"SubstitutionRules '{pattern}': {what}")
        return cls({pattern: configs.get(value, value) for pattern, value in rules.items()})

    def replace(self, node: Node, tree: Tree) -> Node:
        """Return the replacement of ``node``, or itself if no rule matches.

        Raises:
            SubstitutionError: the rule names a node that is not registered.
        """
        pattern = self._pattern(node)
        if pattern is None:
            return node
        rule = self.rules[pattern]
        info: NodeInfo
        if isinstance(rule, TestNodeConfig):
            info = tree.registry.info_of_class(TestNode)
        else:
            found = tree.registry.find(rule)
            if found is None:
                where = f"{self.file}{': ' if self.file else ''}SubstitutionRules '{pattern}'"
                raise SubstitutionError(f"{where}: '{rule}', the replacement of '{node.path}', is not registered")
            info = found
        other = info.cls.__new__(info.cls)
        Node._set_up(other, node.name, node.attributes, [])
        other.info, other.uid, other.place, other.line = info, node.uid, node.place, node.line
        if isinstance(rule, TestNodeConfig) and isinstance(other, TestNode):
            other.config = rule
        return other

    def _pattern(self, node: Node) -> str | None:
        """Return the first filter that matches."""
        names = (node.name, node.type_id)
        for pattern in self.rules:
            literal_brackets = pattern.replace("[", "[[]")
            if pattern in names or re.fullmatch(fnmatch.translate(literal_brackets), node.path):
                return pattern
        return None


def _config(name: str, value: Any) -> TestNodeConfig:
    if not isinstance(value, Mapping):
        raise SubstitutionError(f"TestNodeConfig '{name}' must be an object but is {value!r}")
    known = {"return_status", "return_status_script", "async_delay", "post_script", "success_script", "failure_script"}
    unknown = set(value) - known
    if unknown:
        raise SubstitutionError(f"TestNodeConfig '{name}' has unknown fields {sorted(unknown)}; known: {sorted(known)}")
    if "return_status" not in value and not value.get("return_status_script"):
        raise SubstitutionError(f"TestNodeConfig '{name}' must contain return_status or return_status_script")
    status = value.get("return_status", "SUCCESS")
    if status not in STATUS_NAMES[1:]:
        accepted = ", ".join(STATUS_NAMES[1:])
        raise SubstitutionError(f"TestNodeConfig '{name}': return_status is {status!r}; accepted are {accepted}")
    delay = value.get("async_delay", 0)
    if not isinstance(delay, (int, float)):
        raise SubstitutionError(f"TestNodeConfig '{name}': async_delay must be milliseconds but is {delay!r}")
    try:
        return TestNodeConfig(
            return_status=STATUS_NAMES.index(status),
            return_status_script=str(value.get("return_status_script", "")),
            success_script=str(value.get("success_script", "")),
            failure_script=str(value.get("failure_script", "")),
            post_script=str(value.get("post_script", "")),
            async_delay=delay * 1e-3,
        )
    except ScriptError as error:
        raise SubstitutionError(f"TestNodeConfig '{name}': {error}") from None
