"""From a tree file (or nodes made in Python) to a ``Tree``: instances, blackboards, remapping, scripts."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.blackboard import Blackboard
from bestman_bt.engine.clock import Clock
from bestman_bt.engine.conversion import number_from_text
from bestman_bt.engine.errors import BlackboardError, EngineError, Problem, TreeLoadError
from bestman_bt.engine.node import Conditions, Node
from bestman_bt.engine.ports import key_of
from bestman_bt.engine.registry import NodeInfo, NodeRegistry, closest
from bestman_bt.engine.scripting import ScriptCompiler
from bestman_bt.engine.tree import Tree
from bestman_bt.engine.xml.checking import PRE_CONDITIONS, Checker
from bestman_bt.engine.xml.documents import Documents, read_documents
from bestman_bt.engine.xml.elements import MAX_DEPTH, Element

if TYPE_CHECKING:
    from bestman_bt.engine.substitution import SubstitutionRules

MAX_NODES = 65_535
"""As many as a node number of two bytes can count, in logs and in Groot2's protocol."""

_RESERVED = frozenset(("ID", "name", "_autoremap"))
_TRUE = frozenset(("true", "1", "True", "TRUE"))


def load_tree(
    source: str | Path,
    registry: NodeRegistry | None = None,
    *,
    context: Any = None,
    clock: Clock | None = None,
    main_tree: str | None = None,
    blackboard: Blackboard | None = None,
    search_path: Iterable[Path] = (),
    substitutions: SubstitutionRules | None = None,
) -> Tree:
    """Load a tree from a file (``.xml``, or ``.py`` that defines ``build() -> Node``) or from XML text.

    Args:
        source: a path, or text that begins with ``<``.
        registry: the nodes that the file may name; the built-in ones by default.
        context: handed to every node as ``self.context``.
        clock: what Timeout, Delay, Sleep and the tick loop read; wall time by default.
        main_tree: the tree to run, where the file holds several; overrides ``main_tree_to_execute``.
        blackboard: the root blackboard; a new one by default. Give it a parent to add entries above, for ``@key``.
        search_path: folders that ``<include>`` may reach beside the file's own.
        substitutions: nodes to be replaced by others, for tests.

    Raises:
        TreeLoadError: with everything that is wrong in ``problems``.
    """
    if isinstance(source, Path) or not source.lstrip("\ufeff \t\r\n").startswith("<"):
        path = Path(source)
        if path.suffix == ".py":
            from bestman_bt.engine.authoring import build_tree, load_python_tree

            return build_tree(
                load_python_tree(path), registry=registry, context=context, clock=clock, blackboard=blackboard,
                substitutions=substitutions, tree_id=path.stem, file=str(path),
            )  # fmt: skip
    registry = registry or NodeRegistry()
    with _without_garbage_collection():
        documents = read_documents(source, search_path)
        compiler = ScriptCompiler(registry.enums)
        check_documents(documents, registry, compiler)
        main = main_tree_of(documents, main_tree)
        _raise_if_any(documents.problems)
        assert main is not None
        board = blackboard or Blackboard(main, converters=registry.converters)
        tree = Tree(registry=registry, compiler=compiler, blackboard=board, tree_id=main, context=context, clock=clock)
        tree.file = documents.file
        tree.source = documents.source
        builder = Builder(tree, documents.problems, documents, substitutions)
        definition = documents.trees[main]
        root = builder.build(definition.element.children[0], definition.file, Place(board, "", "", (main,)))
        builder.finish(root)
    return tree


def check_documents(documents: Documents, registry: NodeRegistry, compiler: ScriptCompiler) -> None:
    """Check every tree in the documents; what is wrong is appended to their problems."""
    checker = Checker(registry, compiler, documents)
    for definition in documents.trees.values():
        checker.check(definition)


def main_tree_of(documents: Documents, wanted: str | None) -> str | None:
    """Return the ID of the tree to run; None, and a problem, where it cannot be told."""
    trees = documents.trees
    field = "" if wanted else "main_tree_to_execute"
    name = wanted or documents.main_tree
    if name is not None:
        if name in trees:
            return name
        hint = closest(name, trees)
        message = f"there is no tree '{name}'"
        suggestion = f"did you mean '{hint}'?" if hint else f"trees: {', '.join(trees) or 'none'}"
        documents.problems.append(Problem(documents.file, 1, "root", field, message, suggestion))
        return None
    if len(trees) == 1:
        return next(iter(trees))
    message = "the file holds no <BehaviorTree>"
    if trees:
        message = f"it is missing, and the file holds {len(trees)} trees: {', '.join(trees)}"
    documents.problems.append(Problem(documents.file, 1, "root", field if trees else "", message))
    return None


def _raise_if_any(problems: list[Problem]) -> None:
    errors = [problem for problem in problems if problem.severity == "error"]
    if errors:
        raise TreeLoadError(sorted(errors, key=lambda p: (p.file, p.line)))


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Keep the collector from walking over a growing tree again and again; it cost a third of the load time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class Place:
    """Where nodes are being built: their blackboard, the prefix of their paths, and the trees around them."""

    __slots__ = ("ancestors", "board", "path", "prefix")

    def __init__(self, board: Blackboard, prefix: str, path: str, ancestors: tuple[str, ...]) -> None:
        self.board = board
        self.prefix = prefix
        self.path = path
        self.ancestors = ancestors


class Builder:
    """Makes the nodes of one tree, in construction order."""

    def __init__(
        self,
        tree: Tree,
        problems: list[Problem],
        documents: Documents | None,
        substitutions: SubstitutionRules | None,
    ) -> None:
        self.tree = tree
        self.problems = problems
        self.documents = documents
        self.substitutions = substitutions
        self.depth = 0

    def finish(self, root: Node | None) -> None:
        """Hand the root over to the tree.

        Raises:
            TreeLoadError: something went wrong on the way.
        """
        _raise_if_any(self.problems)
        assert root is not None
        self.tree.complete(root)

    def build(self, element: Element, file: str, place: Place) -> Node:
        """Make the node of an element and all below it."""
        info: NodeInfo = element.info
        attributes: dict[str, Any] = element.attributes
        if element.tag == "SubTree":
            default_name = attributes["ID"]
        else:
            default_name = info.name
        name = attributes.get("name", default_name)
        cls = info.cls
        node: Node
        if info.custom_init and info.kind != "SubTree":
            node = cls(name=name)
            node.attributes = attributes
        else:
            node = cls.__new__(cls)
            node.name = name
            node._s = 0
            node.attributes = attributes
            node.conditions = None
        node.line = element.line
        if info.kind == "SubTree":
            node.tree_id = default_name  # type: ignore[attr-defined]
        node = self.install(node, info, place, file)
        node.children = []
        if len(self.tree.nodes) > MAX_NODES:
            self._report(node, file, f"the tree has more than {MAX_NODES} nodes")
            raise TreeLoadError(self.problems)
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self._report(node, file, f"nodes are nested deeper than {MAX_DEPTH}, SubTrees included")
            raise TreeLoadError(self.problems)
        if node.info is not None and node.info.kind == "SubTree":
            self._build_subtree(node, element, file, place)
        elif element.children:
            children = [self.build(child, file, place) for child in element.children]
            node.children.extend(children)
            for child in children:
                child.parent = node
        self.depth -= 1
        if info.custom_load or node.info is not info:
            self._load(node, file)
        return node

    def install(self, node: Node, info: NodeInfo, place: Place, file: str) -> Node:
        """Give a node its number, blackboard, scripts and declared entries; a substitution may replace it."""
        tree = self.tree
        nodes = tree.nodes
        node.info = info
        node.uid = len(nodes) + 1
        node.tree = tree
        node.board = board = place.board
        node.prefix = place.prefix
        node.file = file
        if self.substitutions is not None:
            node = self.substitutions.replace(node, tree)
        nodes.append(node)
        attributes = node.attributes
        ports = info.ports
        has_scripts = False
        for key, value in attributes.items():
            if key[0] == "_":
                has_scripts = True
            elif key in ports:
                entry = key_of(value, key)
                if entry is not None:
                    try:
                        board.slot(entry).declare(ports[key].data_type)
                    except BlackboardError as error:
                        self._report(node, file, str(error), key)
        if has_scripts:
            self._compile_conditions(node, file)
        return node

    def _compile_conditions(self, node: Node, file: str) -> None:
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
            self._report(node, file, str(error), kind)
        if found:
            node.conditions = conditions

    def _load(self, node: Node, file: str) -> None:
        try:
            node.on_load()
        except TreeLoadError:
            raise
        except (EngineError, ValueError, KeyError, TypeError) as error:
            reason = error.reason if hasattr(error, "reason") else str(error)
            self._report(node, file, str(reason))

    def _report(self, node: Node, file: str, message: str, field: str = "") -> None:
        self.problems.append(Problem(file, node.line, node.type_id, field, message))

    def _build_subtree(self, node: Node, element: Element, file: str, place: Place) -> None:
        assert self.documents is not None
        tree_id = element.attributes["ID"]
        if tree_id in place.ancestors:
            route = " -> ".join((*place.ancestors, tree_id))
            self._report(node, file, f"the trees call each other in a circle: {route}", "ID")
            raise TreeLoadError(self.problems)
        definition = self.documents.trees[tree_id]
        ports = {k: v for k, v in element.attributes.items() if k[0] != "_" and k not in _RESERVED}
        autoremap = element.attributes.get("_autoremap") in _TRUE
        if not autoremap:
            for port in self.documents.models.get(tree_id, {}).values():
                if port.default is not None:
                    ports.setdefault(port.name, port.default)
        inner = self.enter(node, tree_id, "name" in element.attributes, ports, autoremap, place, file)
        child = self.build(definition.element.children[0], definition.file, inner)
        node.children.append(child)
        child.parent = node

    def enter(
        self,
        node: Node,
        tree_id: str,
        named: bool,
        ports: dict[str, Any],
        autoremap: bool,
        place: Place,
        file: str,
    ) -> Place:
        """Make the blackboard of a SubTree and return the place inside it."""
        step = node.name if named else f"{tree_id}::{node.uid}"
        path = f"{place.path}/{step}" if place.path else step
        if path in self.tree.blackboards:
            self._report(
                node, file, f"there are two SubTrees with the path '{path}'; give them different names", "name"
            )
        remapping: dict[str, str] = {}
        literals: dict[str, Any] = {}
        for port, value in ports.items():
            key = key_of(value, port)
            if key is None:
                literals[port] = number_from_text(value) if isinstance(value, str) else value
            else:
                remapping[port] = key
        board = place.board.child(path, remapping, autoremap=autoremap)
        for port, value in literals.items():
            board.local_slot(port).assign(value)
        for port, key in remapping.items():
            if key.startswith("@") and key.count("@") > 1:
                self._report(node, file, f"'{key}' is not a key", port)
        self.tree.blackboards[path] = board
        self.tree.subtree_ids[path] = tree_id
        if hasattr(node, "subtree_path"):
            node.subtree_path = path
        return Place(board, f"{path}/", path, (*place.ancestors, tree_id))


_FIELDS = {"_onSuccess": "on_success", "_onFailure": "on_failure", "_onHalted": "on_halted", "_post": "post"}
