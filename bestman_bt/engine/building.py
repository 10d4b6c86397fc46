"""Building: from the documents of a tree file to a ``Tree`` with blackboards, remapping and scripts."""

from __future__ import annotations

import gc
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from bestman_bt.engine.blackboard import Blackboard
from bestman_bt.engine.clock import EngineClock
from bestman_bt.engine.conversion import number_from_text
from bestman_bt.engine.core.node import NO_PORTS, Node, NodePlace
from bestman_bt.engine.core.ports import key_of, outer_key_of
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
from bestman_bt.engine.core.tick_hooks import Conditions
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import BlackboardError, EngineError, TreeLoadError, TreeProblem
from bestman_bt.engine.graphics import render_svg
from bestman_bt.engine.scripting.compiler import ScriptCompiler
from bestman_bt.engine.spelling import closest
from bestman_bt.engine.xml.checking import PRE_CONDITIONS, Checker
from bestman_bt.engine.xml.documents import Documents, TreeDefinition
from bestman_bt.engine.xml.elements import MAX_DEPTH, NO_CHILDREN, Element
from bestman_bt.engine.xml.writer import tree_to_xml

if TYPE_CHECKING:
    from bestman_bt.engine.blackboard import SharedEntries
    from bestman_bt.engine.substitution import SubstitutionRules

MAX_NODES = 65_535
"""Limit of two-byte node numbers, in logs and in Groot2's protocol."""

_RESERVED = frozenset(("ID", "name", "_autoremap"))
_TRUE = frozenset(("true", "1", "True", "TRUE"))


class LoadOptions(TypedDict, total=False):
    """Common options of all loaders of trees: the arguments of ``new_tree``, by name."""

    context: Any
    """Available to every node as ``self.context``."""
    clock: EngineClock | None
    """The clock of Timeout, Delay, Sleep and the tick loop; wall time by default."""
    blackboard: Blackboard | None
    """The root blackboard; a new one by default. Give it a parent to add entries above, for ``@key``."""
    replaces: Tree | None
    """A tree whose blackboards this one continues to use: the root's, and those of SubTrees with the same ports."""


def load_documents(
    documents: Documents,
    registry: NodeRegistry,
    *,
    main_tree: str | None = None,
    substitutions: SubstitutionRules | None = None,
    faults: list[TreeProblem] | None = None,
    gaps: Gaps | None = None,
    **options: Unpack[LoadOptions],
) -> Tree:
    """Build a tree from documents that were read; ``faults`` and the errors are those of ``load_tree``.

    ``gaps``: replaces nodes and trees that are unknown here, and records them; they are not errors then.
    """
    if documents.old:
        raise TreeLoadError(documents.old)
    compiler = ScriptCompiler(registry.enums)
    main, faulty_names = _checked(documents, registry, compiler, main_tree, faults, gaps)
    tree = new_tree(registry, main, documents.file, compiler, **options)
    tree.source = documents.source
    tree.faulty_names = faulty_names
    return _built(tree, documents, substitutions, faults, gaps)


def new_tree(
    registry: NodeRegistry,
    tree_id: str,
    file: str,
    compiler: ScriptCompiler | None = None,
    *,
    context: Any = None,
    clock: EngineClock | None = None,
    blackboard: Blackboard | None = None,
    replaces: Tree | None = None,
) -> Tree:
    """Create a tree without nodes."""
    compiler = compiler or ScriptCompiler(registry.enums)
    board = (
        replaces.blackboard
        if replaces is not None
        else blackboard or Blackboard(tree_id, converters=registry.converters)
    )
    tree = Tree(
        registry=registry, compiler=compiler, blackboard=board, tree_id=tree_id,
        context=context, clock=clock, to_xml=tree_to_xml, to_svg=render_svg,
    )  # fmt: skip
    tree.file = file
    tree.replaces = replaces
    return tree


class Gaps(ABC):
    """Handles nodes and trees that have no code here, but may exist in another BehaviorTree.CPP process."""

    suggests = True
    """Whether problems suggest remedies for unknown nodes; each search for similar names takes milliseconds."""

    def __init__(self) -> None:
        self.problems: list[TreeProblem] = []

    def take(self, problems: list[TreeProblem]) -> None:
        """Record the problems about unknown parts instead of reporting them."""
        self.problems += [problem for problem in problems if problem.missing]
        problems[:] = [problem for problem in problems if not problem.missing]

    @abstractmethod
    def fill(self, checker: Checker) -> None:
        """Replace ``checker.misfits`` and missing trees."""


def _checked(
    documents: Documents,
    registry: NodeRegistry,
    compiler: ScriptCompiler,
    main_tree: str | None,
    faults: list[TreeProblem] | None,
    gaps: Gaps | None,
) -> tuple[str, set[str]]:
    """Return the tree to run and ``Tree.faulty_names``; raises the errors of ``load_tree``."""
    main = main_tree_of(documents, main_tree)
    checker = check_documents(documents, registry, compiler, main, suggests=gaps is None or gaps.suggests)
    wrong = checker.wrong
    if gaps is not None:
        gaps.fill(checker)
        gaps.take(documents.problems)
        filled = set(map(id, checker.misfits))
        wrong = [(element, attribute) for element, attribute in wrong if id(element) not in filled]
    faulty_names: set[str] = set()
    if faults is None:
        raise_if_any(documents.problems)
    else:
        faults += [problem for problem in documents.problems if problem.severity != "warning"]
        documents.problems[:] = [problem for problem in documents.problems if problem.severity == "warning"]
        if main is None:
            raise TreeLoadError(_in_order(faults))
        faulty_names = _leave_out(wrong, registry)
        for one in documents.trees.values():
            if len(one.element.children) != 1:
                one.element.children = [_instead(one.element, registry)]
    assert main is not None
    return main, faulty_names


def _built(
    tree: Tree,
    documents: Documents,
    substitutions: SubstitutionRules | None,
    faults: list[TreeProblem] | None,
    gaps: Gaps | None,
) -> Tree:
    builder = Builder(tree, documents.problems, documents, substitutions)
    main = tree.tree_id
    definition = documents.trees[main]
    builder.under_way.append(definition)
    try:
        root = builder.build(
            definition.element.children[0], NodePlace(tree, tree.blackboard, "", (main,), definition.file)
        )
    except TreeLoadError as error:
        raise TreeLoadError(_in_order([*(faults or ()), *error.problems])) from None
    if gaps is not None:
        gaps.take(builder.problems)
    if faults is not None:  # what was left out of a node may be missed while it is made
        reported = {(problem.file, problem.line) for problem in faults}
        errors = [problem for problem in builder.problems if problem.severity == "error"]
        faults += [problem for problem in errors if (problem.file, problem.line) not in reported]
        builder.problems[:] = [problem for problem in builder.problems if problem.severity != "error"]
    builder.finish(root)
    return tree


def _leave_out(wrong: list[tuple[Element, str]], registry: NodeRegistry) -> set[str]:
    """Remove wrong attributes from their elements, and replace a wrong element by its children, if any.

    Returns the entries and other names that they refer to.
    """
    named: set[str] = set()
    for element, attribute in wrong:
        gone = element.attributes if attribute in ("", "ID", "name") else {attribute: element.attributes.get(attribute)}
        named |= entries_named_in(gone)
        if attribute and attribute not in ("ID", "name"):
            element.attributes.pop(attribute, None)
            element.entries = [entry for entry in element.entries or () if entry[0] != attribute] or None
        else:
            element.tag = "Sequence" if element.children else "AlwaysSuccess"
            element.info, element.attributes, element.entries = registry.info(element.tag), {}, None
    return named


def _instead(element: Element, registry: NodeRegistry) -> Element:
    """Return a Sequence of all children of an element that may have only one, or AlwaysSuccess without children."""
    made = Element("Sequence" if element.children else "AlwaysSuccess", {}, element.line)
    made.info, made.children = registry.info(made.tag), element.children
    return made


def entries_named_in(attributes: Mapping[str, Any]) -> set[str]:
    """Return the entries that attributes may name, in ports, in scripts or as entry names."""
    keys = {key for port, value in attributes.items() if (key := key_of(value, port)) is not None}
    return keys.union(*(re.findall(r"\w+", str(value)) for value in attributes.values()))


def check_documents(
    documents: Documents, registry: NodeRegistry, compiler: ScriptCompiler, main: str | None, suggests: bool = True
) -> Checker:
    """Check every tree in the documents, and append the faults to their problems.

    Faulty nodes in trees that ``main`` does not use do not prevent loading; None: all trees count as used.
    """
    checker = Checker(registry, compiler, documents, suggests)
    used = documents.trees.keys() if main is None or len(documents.trees) == 1 else documents.used_trees(main)
    for tree_id, definition in documents.trees.items():
        checker.check(definition, used=tree_id in used)
    for definition in documents.replaced:
        checker.check(definition, used=False)
    return checker


class NoMainTree(TreeProblem):
    """The file holds several trees, and the main tree is not specified."""


def main_tree_of(documents: Documents, wanted: str | None) -> str | None:
    """Return the ID of the tree to run, or None, with a problem recorded, if it is ambiguous or missing."""
    trees = documents.trees
    field = "" if wanted else "main_tree_to_execute"
    name = wanted or documents.main_tree
    if name is not None:
        if name in trees:
            return name
        hint = closest(name, trees)
        message = f"there is no tree '{name}'"
        suggestion = f"did you mean '{hint}'?" if hint else f"trees: {', '.join(trees) or 'none'}"
        documents.problems.append(TreeProblem(documents.file, 1, "root", field, message, suggestion))
        return None
    if len(trees) == 1:
        return next(iter(trees))
    if not trees and documents.problems:
        return None
    if not trees:
        documents.problems.append(TreeProblem(documents.file, 1, "root", "", "the file holds no <BehaviorTree>"))
        return None
    message = f"the attribute is missing, and the file holds {len(trees)} trees: {', '.join(trees)}"
    own = [name for name in trees if trees[name].file == documents.file]
    roots = documents.unused_trees()
    suggestion = f'write main_tree_to_execute="{(roots or own or list(trees))[0]}"'
    documents.problems.append(NoMainTree(documents.file, 1, "root", field, message, suggestion, missing=True))
    return None


def raise_if_any(problems: list[TreeProblem]) -> None:
    """Raise TreeLoadError with the problems that are errors, if any."""
    errors = [problem for problem in problems if problem.severity == "error"]
    if errors:
        raise TreeLoadError(_in_order(errors))


def _in_order(problems: Iterable[TreeProblem]) -> list[TreeProblem]:
    return sorted(problems, key=lambda problem: (problem.file, problem.line))


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Pause garbage collection while a tree grows; repeated collections cost a third of the load time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def declare(board: Blackboard, key: str, data_type: Any) -> None:
    """Make the entry that a port is mapped to exist, or check that the port's type fits it.

    Raises:
        BlackboardError: the type does not fit.
    """
    slot = board.slot(key)
    if not slot.exists:
        slot = board.slot_to_write(key)
    slot.declare(data_type)


class Builder:
    """Creates the nodes of one tree, in construction order."""

    def __init__(
        self,
        tree: Tree,
        problems: list[TreeProblem],
        documents: Documents | None,
        substitutions: SubstitutionRules | None,
    ) -> None:
        self.tree = tree
        self.problems = problems
        self.documents = documents
        self.substitutions = substitutions
        self.depth = 0
        self.under_way: list[TreeDefinition] = []

    def finish(self, root: Node | None, shared: SharedEntries | None = None) -> None:
        """Complete the tree with its root.

        Raises:
            TreeLoadError: a node could not be built.
        """
        raise_if_any(self.problems)
        assert root is not None
        self.tree.compiler.forget()
        self.tree.complete(root, self.depth, shared)
        self.tree.replaces = None

    def build(self, element: Element, place: NodePlace, depth: int = 1) -> Node:
        """Build the node of an element and its descendants."""
        info: NodeInfo = element.info
        attributes: dict[str, Any] = element.attributes
        cls = info.cls
        node: Node
        if info.custom_init:
            node = cls(name=attributes.get("name", info.name))
            node.attributes = attributes
            node.children = []
        else:
            node = cls.__new__(cls)
            node.name = attributes.get("name", info.name)
            node._s = 0
            node.attributes = attributes
            node.children = NO_CHILDREN
            node._readers = node._writers = NO_PORTS
            node.conditions = node.hooks = node.parent = None
        node.info = info
        node.place = place
        node.line = element.line
        nodes = self.tree.nodes
        node.uid = len(nodes) + 1
        if self.substitutions is not None:
            node = self.substitutions.replace(node, self.tree)
            attributes = node.attributes
        nodes.append(node)
        self.depth = max(self.depth, depth)
        if node.uid > MAX_NODES or depth > MAX_DEPTH:
            self._refuse_size(node)
        if element.entries is not None:
            self._declare(node, place.board, element.entries)
        if element.scripts:
            self._compile_conditions(node)
        if element.children:
            children = [self.build(child, place, depth + 1) for child in element.children]
            node.children = [*children]
            for child in children:
                child.parent = node
        elif info.kind == "SubTree" and isinstance(node, SubTree):
            self._build_subtree(node, element, place, depth)
        if info.custom_load or node.info is not info:
            self._load(node)
        return node

    def _declare(self, node: Node, board: Blackboard, entries: Iterable[tuple[str, str, Any]]) -> None:
        for port, key, data_type in entries:
            try:
                declare(board, key, data_type)
            except BlackboardError as error:
                self._report(node, str(error), port)

    def install(self, node: Node, info: NodeInfo, place: NodePlace) -> Node:
        """Give an existing node its number, place, entries and scripts; a substitution may replace it."""
        node.info = info
        node.place = place
        node.uid = len(self.tree.nodes) + 1
        if self.substitutions is not None:
            node = self.substitutions.replace(node, self.tree)
        self.tree.nodes.append(node)
        has_scripts = False
        for port, value in node.attributes.items():
            has_scripts = has_scripts or port[0] == "_"
            key = key_of(value, port) if port in info.ports else None
            if key is not None:
                try:
                    declare(place.board, key, info.ports[port].data_type)
                except BlackboardError as error:
                    self._report(node, str(error), port)
        if has_scripts:
            self._compile_conditions(node)
        return node

    def _refuse_size(self, node: Node) -> None:
        if node.uid > MAX_NODES:
            self._report(node, f"the tree has more than {MAX_NODES} nodes")
        else:
            self._report(node, f"nodes are nested deeper than {MAX_DEPTH}, SubTrees included")
        raise TreeLoadError(self.problems)

    def _compile_conditions(self, node: Node) -> None:
        compiler, board, attributes = self.tree.compiler, node.board, node.attributes
        conditions = Conditions()
        found = False
        try:
            for kind in PRE_CONDITIONS:
                if kind in attributes:
                    conditions.pre.append((kind, compiler.compile_condition(attributes[kind], board)))
                    found = True
            for kind in ("_onSuccess", "_onFailure", "_onHalted", "_post"):
                if kind in attributes:
                    script = compiler.compile(attributes[kind], board)
                    setattr(conditions, _FIELDS[kind], script)
                    found = True
        except EngineError as error:
            self._report(node, str(error), kind, may_be_missing=False)
        if found:
            node.conditions = conditions

    def _load(self, node: Node) -> None:
        try:
            node.on_load()
        except TreeLoadError:
            raise
        except (EngineError, ValueError, KeyError, TypeError) as error:
            reason = error.reason if hasattr(error, "reason") else str(error)
            self._report(node, str(reason))

    def _report(self, node: Node, message: str, field: str = "", *, may_be_missing: bool = True) -> None:
        file = self.tree.file if node.place is None else node.place.file
        missing = may_be_missing and not (node.info is not None and node.info.builtin)
        self.problems.append(TreeProblem(file, node.line, node.type_id, field, message, missing=missing))

    def _build_subtree(self, node: SubTree, element: Element, place: NodePlace, depth: int) -> None:
        assert self.documents is not None
        attributes = element.attributes
        tree_id = node.tree_id = attributes["ID"]
        node.name = attributes.get("name", tree_id)
        definition = self.documents.find(tree_id, place.file)
        assert definition is not None
        if tree_id in place.ancestors and (not self.documents.scoped or definition in self.under_way):
            route = " -> ".join((*place.ancestors, tree_id))
            self._report(node, f"the trees include each other recursively: {route}", "ID")
            raise TreeLoadError(self.problems)
        ports = {k: v for k, v in attributes.items() if k[0] != "_" and k not in _RESERVED}
        autoremap = attributes.get("_autoremap") in _TRUE
        if not autoremap:
            for port in self.documents.models.get(tree_id, {}).values():
                if port.default is not None:
                    ports.setdefault(port.name, port.default)
        inner = self.enter(node, "name" in attributes, ports, autoremap, place, definition.file)
        self.under_way.append(definition)
        child = self.build(definition.element.children[0], inner, depth + 1)
        self.under_way.pop()
        node.children = [child]
        child.parent = node

    def enter(
        self, node: SubTree, named: bool, ports: dict[str, Any], autoremap: bool, place: NodePlace, file: str
    ) -> NodePlace:
        """Create the blackboard of a SubTree and return the place inside it."""
        step = node.name if named else f"{node.tree_id}::{node.uid}"
        path = place.prefix + step
        if path in self.tree.blackboards:
            self._report(node, f"there are two SubTrees with the path '{path}'; give them different names", "name")
        remapping: dict[str, str] = {}
        literals: dict[str, Any] = {}
        for port, value in ports.items():
            key = outer_key_of(value, port)
            if key is None:
                literals[port] = number_from_text(value) if isinstance(value, str) else value
            elif key == "@" or key.count("@") > 1:
                self._report(node, f"'{key}' is not a key", port)
            else:
                remapping[port] = key
        earlier = self._earlier_board(node, path)
        if earlier is not None and earlier.parent is place.board:
            board = earlier
        else:
            board = place.board.child(path, remapping, autoremap=autoremap)
            for port, value in literals.items():
                board.local_slot(port).assign(value)
        self.tree.blackboards[path] = board
        self.tree.subtree_ids[path] = node.tree_id
        node.subtree_path = path
        return NodePlace(self.tree, board, path, (*place.ancestors, node.tree_id), file)

    def _earlier_board(self, node: SubTree, path: str) -> Blackboard | None:
        """Return the blackboard of the same SubTree, with the same ports, in the tree that this one replaces."""
        replaces, earlier = self.tree.replaces, self._earlier_subtrees.get(path)
        if replaces is None or earlier is None or earlier.attributes != node.attributes:
            return None
        return replaces.blackboards.get(path)

    @cached_property
    def _earlier_subtrees(self) -> dict[str, SubTree]:
        """The SubTrees of the tree that this one replaces, by the path of the node that they represent."""
        nodes = [] if self.tree.replaces is None else self.tree.replaces.nodes
        return {node.subtree_path: node for node in nodes if isinstance(node, SubTree)}


_FIELDS = {"_onSuccess": "on_success", "_onFailure": "on_failure", "_onHalted": "on_halted", "_post": "post"}
