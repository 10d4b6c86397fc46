"""Checks elements against the registry: names, children, ports, literals and scripts, all errors at once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from bestman_bt.engine.blackboard import key_fault
from bestman_bt.engine.bounds import refusal
from bestman_bt.engine.catalogue import EXTENSIONS
from bestman_bt.engine.conversion import UNTYPED, cast, partly_read, to_int, type_name
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
from bestman_bt.engine.core.strict_order import STRICT
from bestman_bt.engine.errors import ConversionError, ScriptError, TreeProblem
from bestman_bt.engine.leaves.blackboard import names_entry
from bestman_bt.engine.leaves.function import class_name
from bestman_bt.engine.scripting.compiler import ScriptCompiler
from bestman_bt.engine.scripting.parser import assigns_to_no_key
from bestman_bt.engine.spelling import closest
from bestman_bt.engine.status import NodeStatus
from bestman_bt.engine.xml.documents import RENAMED, Documents, TreeDefinition
from bestman_bt.engine.xml.elements import NO_CHILDREN, Element

EXPLICIT: Final = frozenset(("Action", "Condition", "Control", "Decorator"))
_UNSIGNED: Final = ("msec", "delay_msec")
_LEAVES: Final = ("Action", "Condition")
_NEVER_NODES: Final = ("BehaviorTree", "TreeNodesModel")
PRE_CONDITIONS: Final = ("_failureIf", "_successIf", "_skipIf", "_while")
POST_CONDITIONS: Final = ("_onHalted", "_onSuccess", "_onFailure", "_post")
SCRIPTS: Final = frozenset((*PRE_CONDITIONS, *POST_CONDITIONS))
_SINGLE_QUOTED: Final = re.compile(r"'[^']*'")
_BOOLS: Final = frozenset(("true", "false", "1", "0", "True", "False", "TRUE", "FALSE"))

Report = Callable[[str, str, str], None]
"""Called with the attribute, its fault and a suggestion."""


class Checker:
    """Checks all trees of one set of documents, and appends the problems to ``documents.problems``.

    ``wrong``: faulty elements, each with the faulty attribute (empty: the element itself). ``misfits``: those that may
    be valid in another BehaviorTree.CPP process. ``suggests``: whether unknown nodes are reported with suggestions.
    """

    def __init__(
        self, registry: NodeRegistry, compiler: ScriptCompiler, documents: Documents, suggests: bool = True
    ) -> None:
        self.registry = registry
        self.compiler = compiler
        self.documents = documents
        self.suggests = suggests
        self.file = documents.file
        self.wrong: list[tuple[Element, str]] = []
        self.misfits: list[Element] = []
        self._missing = False
        self._remedies: dict[str, str] = {}
        self._wrong = "error"
        self._infos = {info.name: info for info in registry}

    def check(self, definition: TreeDefinition, *, used: bool = True) -> None:
        """Check one tree; in an unused tree, faulty attributes of nodes are latent."""
        self.file = definition.file
        self._wrong = "error" if used else "latent"
        same = self.registry.find(definition.tree_id)
        if same is not None and not same.known_from:
            element = definition.element
            self._missing = not same.builtin
            self._report(element, "ID", f"'{definition.tree_id}' is the name of a node; a tree needs another")
            self._missing = False
        for child in definition.element.children:
            self._check(child)

    def _report(
        self,
        element: Element,
        field: str,
        message: str,
        suggestion: str = "",
        severity: str = "error",
        *,
        attribute: str = "",
    ) -> None:
        name = element.attributes.get("ID", element.tag) if element.tag in EXPLICIT else element.tag
        if severity == "error":
            self.wrong.append((element, attribute or field))
        if self._missing and severity != "warning":
            self.misfits.append(element)
        self.documents.problems.append(
            TreeProblem(self.file, element.line, name, field, message, suggestion, severity, self._missing)
        )

    def _check(self, element: Element) -> None:
        tag = element.tag
        if tag == "SubTree":
            self._check_subtree(element)
        elif tag in _NEVER_NODES or ":" in tag:
            self._report(element, "", "it is not a node" if tag in _NEVER_NODES else "the name of a node has no ':'")
        else:
            self._check_node(element)
        for child in element.children:
            self._check(child)
        if tag == "SubTree" and element.children:
            what = "a <SubTree> has no children of its own"
            self.documents.problems.append(TreeProblem(self.file, element.line, tag, "", what))
            element.children = NO_CHILDREN

    def _check_node(self, element: Element) -> None:
        name = tag = element.tag
        if tag in EXPLICIT:
            name = element.attributes.get("ID", "")
            if not name:
                self._report(element, "ID", "the attribute is missing; it names the node")
        info = self._infos.get(name)
        if (info is None or info.known_from) and name:
            self._missing = True
            if name not in self._remedies:
                self._remedies[name] = self._remedy(name) if self.suggests else ""
            self._report(element, "", f"unknown node '{name}'", self._remedies[name])
        if info is not None:
            self._missing = not info.builtin or name in EXTENSIONS
            self._check_known(element, name, info)
        self._missing = False

    def _check_known(self, element: Element, name: str, info: NodeInfo) -> None:
        tag, attributes, children = element.tag, element.attributes, element.children
        element.info = info
        if tag in EXPLICIT and info.kind != tag:
            message, suggestion = f"'{name}' is of kind {info.kind}, not {tag}", f'write <{info.kind} ID="{name}">'
            self._report(element, "", message, suggestion, "error" if info.kind == "SubTree" else "warning")
        count = len(children)
        if count < info.min_children or (info.max_children is not None and count > info.max_children):
            severity = "latent" if info.checked_at_tick and count else "error"
            missing = self._missing
            self._missing = missing and not (tag in _LEAVES and info.kind in _LEAVES)  # wrong whatever the node is
            self._report(element, "", _children_message(info, count), "", severity)
            self._missing = missing
        if name == "ReactiveSequence" and sum(child.tag == "AsyncSequence" for child in children) > 1:
            self._report(element, "", "it cannot have more than one AsyncSequence among its children")
        if attributes:
            self._check_attributes(element, info)
        for key in info.required:
            if key not in attributes:
                severity = "latent" if info.checked_at_tick else self._wrong
                kind = f"of type {info.ports[key].type_name}"
                self._report(element, key, "it is required but not given", kind, severity)

    @cached_property
    def _shipped(self) -> dict[str, str]:
        """How each tree is included that lies in a folder of the search path."""
        files = [(folder, file) for folder in self.documents.search_path for file in sorted(folder.glob("*/*.xml"))]
        return {
            tree_id: f'<include path="{file.relative_to(folder)}"/>'
            for folder, file in files
            for tree_id in re.findall(r'<BehaviorTree ID="(\w+)"', file.read_text("utf-8", "replace"))
        }

    def _remedy(self, name: str) -> str:
        """Return a remedy for an unknown node: the file beside the tree that defines it, or the closest name."""
        if name in RENAMED:
            return f"version 4 calls it {RENAMED[name]}"
        if name in self.documents.trees:
            return f'it is a tree: write <SubTree ID="{name}"/>'
        for path in sorted(Path(self.file).parent.glob("*.py")):
            defined = re.findall(r"^(?:class|def) (\w+)", path.read_text("utf-8", "replace"), re.MULTILINE)
            if name in defined or name in map(class_name, defined):
                return f"{path} defines one: bring it with --plugin {path}"
        hint = closest(name, [*(known for known, info in self._infos.items() if not info.known_from), *self._shipped])
        if hint in self._shipped:
            return f'the shipped tree {hint} is used by <SubTree ID="{hint}"/> and, under <root>, {self._shipped[hint]}'
        return f"did you mean '{hint}'?" if hint else "load your own nodes with --plugin FILE.py"

    def _tree_remedy(self, tree_id: str) -> str:
        if tree_id in self._shipped:
            return f"the shipped one needs, under <root>, {self._shipped[tree_id]}"
        hint = closest(tree_id, self.documents.trees)
        return f"did you mean '{hint}'?" if hint else ""

    def _check_attributes(self, element: Element, info: NodeInfo) -> None:
        ports = info.ports
        checked = info.checked
        for key, text in element.attributes.items():
            if key == "name":
                continue
            port = ports.get(key)
            if port is None:
                self._check_other(element, info, key, text)
                continue
            if text[:1] in "{ =":
                entry = key_of(text, key)
                if entry is not None:
                    if element.entries is None:
                        element.entries = []
                    element.entries.append((key, entry, port.data_type))
                    self._check_mapping(element, info, key, text)
                    continue
            if port.direction == "output":
                self._check_output(element, info, key, text)
            elif key in checked or names_entry(info.cls, key):
                self._check_literal(element, info, key, text)
            elif key == "code" and info.builtin and (text or info.name != "Script"):
                self._check_script(element, key, text)

    def _check_mapping(self, element: Element, info: NodeInfo, key: str, text: str) -> None:
        port = info.ports[key]
        if key == "code" and info.builtin:
            what = "not portable: BehaviorTree.CPP takes the text of the script, not an entry"
            self._report(element, key, what, "", "warning")
        elif text == "=" and port.direction != "input" and port.data_type not in (*UNTYPED, str):
            self._report(element, key, "not portable: BehaviorTree.CPP refuses '='", "write {=}", "warning")

    def _check_literal(self, element: Element, info: NodeInfo, key: str, text: str) -> None:
        message = literal_message(info, key, text, self.registry)
        data_type = info.ports[key].data_type
        if message:
            self._report(element, key, message, "", "latent" if data_type is NodeStatus else self._wrong)
        elif data_type in (int, float) and partly_read(text, data_type):
            self._report(element, key, f"only the beginning of '{text}' is read as a number", "", "warning")
        elif data_type is int and info.builtin:
            most = 2**32 - 1 if key in _UNSIGNED else 2**31 - 1
            if to_int(text) > most:
                self._report(element, key, f"not portable: BehaviorTree.CPP takes at most {most}", "", "warning")

    def _check_output(self, element: Element, info: NodeInfo, key: str, text: str) -> None:
        message = literal_message(info, key, text, self.registry) if info.ports[key].data_type is not str else ""
        if message:
            self._report(element, key, _output_message(info, key, text), "", self._wrong)
        else:
            self._report(element, key, f"nothing is written: {_output_message(info, key, text)}", "", "warning")

    def _check_subtree(self, element: Element) -> None:
        tree_id = element.attributes.get("ID")
        if not tree_id:
            self._report(element, "ID", "the attribute is missing; it names the tree")
        elif tree_id not in self.documents.trees:
            self._missing = True
            self._report(element, "ID", f"there is no tree '{tree_id}'", self._tree_remedy(tree_id), self._wrong)
            self._missing = False
        element.info = self._infos["SubTree"]
        for key, text in element.attributes.items():
            if key in SCRIPTS:
                self._check_script(element, key, text)
            elif key == "_autoremap" and text not in _BOOLS:
                self._report(element, key, f"'{text}' is not a bool", "", self._wrong)
        model = self.documents.models.get(tree_id or "", {})
        if model and element.attributes.get("_autoremap") not in ("true", "1", "True", "TRUE"):
            for port in model.values():
                if port.default is None and port.name not in element.attributes:
                    message = f"the TreeNodesModel of '{tree_id}' declares it as mandatory"
                    self._report(element, port.name, message, "", self._wrong)

    def _check_other(self, element: Element, info: NodeInfo, key: str, text: str) -> None:
        if key in SCRIPTS:
            self._check_script(element, key, text)
        elif key == "ID":
            if element.tag not in EXPLICIT:
                missing, self._missing = self._missing, False
                message, suggestion = "the attribute is not allowed here", f'write <{info.kind} ID="{element.tag}">'
                self._report(element, key, message, suggestion, self._wrong)
                self._missing = missing
        elif key == STRICT and text not in _BOOLS:
            self._report(element, key, f"'{text}' is not a bool", "", self._wrong)
        elif key[0] != "_" and ":" not in key and "." not in key:  # these are not port names, and are ignored
            message, suggestion = unknown_port(info, key)
            severity = "warning" if info.known_from else self._wrong
            self._report(element, "", message, suggestion, severity, attribute=key)

    def _check_script(self, element: Element, key: str, text: str) -> None:
        element.scripts = element.scripts or key != "code"
        missing, self._missing = self._missing, False
        self._check_statements(element, key, text)
        self._missing = missing

    def _check_statements(self, element: Element, key: str, text: str) -> None:
        try:
            statements = self.compiler.parse(text)
        except ScriptError as error:
            self._report(element, key, str(error), "", self._wrong)
            return
        if '"' in _SINGLE_QUOTED.sub("", text):
            message = "not portable: BehaviorTree.CPP refuses strings in double quotes"
            self._report(element, key, message, "write them in single ones", "warning")
        if any(assigns_to_no_key(statement) for statement in statements):
            self._report(element, key, f"only a blackboard key can be assigned to, in '{text[:80]}'", "", "latent")


def unknown_port(info: NodeInfo, key: str) -> tuple[str, str]:
    """Return message and suggestion for an attribute that is not a port of a node."""
    hint = closest(key, info.ports)
    known = ", ".join(info.ports) or "none"
    return f"unknown port '{key}'", f"did you mean '{hint}'?" if hint else f"its ports: {known}"


def literal_message(info: NodeInfo, key: str, value: Any, registry: NodeRegistry) -> str:
    """Return the fault of a literal, or an empty text."""
    port = info.ports[key]
    if names_entry(info.cls, key):
        return key_fault(str(value))
    if port.data_type in UNTYPED:
        return ""
    try:
        if isinstance(value, str):
            converter = registry.converters.converter(port.data_type)
            if converter is None:
                return f"a {type_name(port.data_type)} cannot be written as a literal; map an entry, as '{{{key}}}'"
            typed = converter(value)
        else:
            typed = cast(value, port.data_type, registry.converters)
    except ConversionError as error:
        return str(error)
    if _holds_nan(typed):
        return f"{value!r} is not a number"
    if port.bounds is None:
        return ""
    means = f" ({port.description})" if port.description else ""
    if isinstance(value, str) and partly_read(value, port.data_type):
        number = "a whole number" if port.data_type is int else "a number"
        return f"{value!r} is not accepted: give {number} alone, without a unit{means}"
    wrong = refusal(typed, port.bounds)
    return wrong + means if typed in (math.inf, -math.inf) else wrong


def _holds_nan(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return any(_holds_nan(entry) for entry in value)
    return isinstance(value, float) and math.isnan(value)


def _output_message(info: NodeInfo, key: str, value: Any) -> str:
    return f"an output port is mapped to an entry, as '{{{key}}}', not to '{value}'"


def _children_message(info: NodeInfo, count: int) -> str:
    if info.kind in ("Action", "Condition"):
        return f"it must not have children but has {count}"
    if info.kind == "Decorator":
        return f"it must have exactly one child but has {count}"
    if info.max_children == info.min_children:
        return f"it must have exactly {info.min_children} children but has {count}"
    if info.max_children is not None and count > info.max_children:
        return f"it must have at most {info.max_children} children but has {count}"
    return f"it must have at least {info.min_children} children but has {count}"


def check_values(
    info: NodeInfo, attributes: Mapping[str, Any], registry: NodeRegistry, compiler: ScriptCompiler, report: Report
) -> None:
    """Check the attributes of a node made in Python."""
    for key, value in attributes.items():
        if key in SCRIPTS or (key == "code" and info.builtin and isinstance(value, str)):
            if key in SCRIPTS or key_of(value, key) is None:
                try:
                    compiler.parse(value)
                except (ScriptError, TypeError) as error:
                    report(key, str(error), "")
        else:
            _check_port_value(info, key, value, registry, report)
    for key in info.required:
        if key not in attributes:
            report(key, "it is required but not given", f"of type {info.ports[key].type_name}")


def _check_port_value(info: NodeInfo, key: str, value: Any, registry: NodeRegistry, report: Report) -> None:
    port = info.ports.get(key)
    if port is None:
        if not key.startswith("_"):
            message, suggestion = unknown_port(info, key)
            report("", message, suggestion)
    elif key_of(value, key) is None:
        if port.direction == "output":
            report(key, _output_message(info, key, value), "")
        elif message := literal_message(info, key, value, registry):
            report(key, message, "")
