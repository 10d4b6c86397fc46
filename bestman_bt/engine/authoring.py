"""Trees in Python: nodes with the same form as in XML, built by the same builder.

    Sequence("fetch", [
        NavigateTo(goal="{stand}"),
        RetryUntilSuccessful(Grasp(target="{cup}"), num_attempts=3),
        SubTree(build_place, where="{counter}"),
    ])

Ports are keyword arguments: a literal as a Python value, or ``"{key}"``. Scripts are ``_skipIf="..."`` and the like.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from py_trees.behaviour import Behaviour

from bestman_bt.engine.blackboard import SharedEntries
from bestman_bt.engine.building import (
    MAX_NODES,
    Builder,
    LoadOptions,
    check_documents,
    entries_named_in,
    main_tree_of,
    new_tree,
    raise_if_any,
)
from bestman_bt.engine.core.node import Node, NodePlace
from bestman_bt.engine.core.py_trees_adapter import PyTreesAdapter
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.leaves.native import PyTreesBehaviour, adapted, belongs_to_tree, take_over
from bestman_bt.engine.scripting.compiler import ScriptCompiler
from bestman_bt.engine.xml.checking import check_values
from bestman_bt.engine.xml.documents import read_documents
from bestman_bt.engine.xml.elements import MAX_DEPTH

if TYPE_CHECKING:
    from bestman_bt.engine.core.registry import NodeInfo
    from bestman_bt.engine.substitution import SubstitutionRules

_SUBTREE_RESERVED = frozenset(("name", "ID"))


def build_tree(
    root: Behaviour,
    *,
    registry: NodeRegistry | None = None,
    substitutions: SubstitutionRules | None = None,
    tree_id: str = "MainTree",
    file: str = "<python>",
    faults: list[TreeProblem] | None = None,
    **options: Unpack[LoadOptions],
) -> Tree:
    """Build a tree from nodes created in Python; native py_trees behaviours get wrapper nodes.

    ``faults`` and ``options``: as in ``load_tree``.

    Raises:
        TreeLoadError: listing every fault in ``problems``.
    """
    tree = new_tree(registry or NodeRegistry(), tree_id, file, **options)
    board = tree.blackboard
    has_native = any(not isinstance(node, Node) for node in root.iterate())
    if has_native:
        board.share()
    adopter = _Adopter(tree, [], None, substitutions)
    node = adopter.adopt(root, NodePlace(tree, board, "", (tree_id,), file))
    if faults is not None:
        faults += adopter.problems
        adopter.problems.clear()
    native = [found.behaviour for found in tree.nodes if isinstance(found, PyTreesBehaviour)]
    adopter.finish(node, SharedEntries(board, native) if has_native else None)
    node.parent = None
    return tree


PyTreesAdapter.build_own_tree = staticmethod(build_tree)


@cache
def named_from(tree_file: str, file: str) -> str:
    """Return the name of a file for messages, relative to the tree's own file where possible."""
    own, found = Path(tree_file), Path(file).resolve()
    if found == own.resolve():
        return tree_file
    folder = own.resolve().parent
    beside = not tree_file.startswith("<") and found.is_relative_to(folder)
    return str(own.parent / found.relative_to(folder)) if beside else file


class _Adopter(Builder):
    """Takes nodes that exist already into the tree."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._places: dict[tuple[NodePlace, str], NodePlace] = {}

    def adopt(self, behaviour: Behaviour, place: NodePlace, depth: int = 1, parent: Node | None = None) -> Node:
        made = behaviour if isinstance(behaviour, Node) else adapted(behaviour)
        if made.place is not None or (made is not behaviour and belongs_to_tree(behaviour)):
            self._report(made, f"'{made.name}' is part of a tree already; make a new node")
            return made
        place = self._where_made(made, place)
        made.place = place
        info = self.tree.registry.info_of_class(type(made))
        made.attributes = {_port_name(key): value for key, value in made.attributes.items()}
        failed = len(self.problems)
        if info.kind != "SubTree":
            self._check(made, info)
        node = self.install(made, info, place)
        node.parent = parent
        self.depth = max(self.depth, depth)
        if len(self.tree.nodes) > MAX_NODES or depth > MAX_DEPTH:
            self._refuse_size(node)
        if made is not behaviour or isinstance(parent, PyTreesBehaviour):
            take_over(behaviour, node)
        if made is not behaviour and not isinstance(parent, PyTreesBehaviour):
            behaviour.parent = parent
        if isinstance(node, SubTree) and node.loaded is not None:
            node.children = [self._read(node, node.loaded, place, depth + 1)]
        elif made is node or made is behaviour:  # what replaces a native behaviour, replaces those below it
            inner = self._enter(node, place, self.tree.file) if isinstance(node, SubTree) else place
            node.children = [self.adopt(child, inner, depth + 1, node) for child in behaviour.children]
        if len(self.problems) == failed:
            self._load(node)
        else:
            self._leave_out(node, self.problems[failed:])
        return node

    def _leave_out(self, node: Node, wrong: list[TreeProblem]) -> None:
        """Remove wrong ports from the node, so that the rest can be checked."""
        self.tree.faulty_names |= entries_named_in(node.attributes)
        for problem in wrong:
            if problem.line == node.line:
                node.attributes.pop(problem.field, None)

    def _read(self, node: SubTree, loaded: Tree | Path, place: NodePlace, depth: int) -> Node:
        """Build the node of a SubTree from XML, with the entries given to its loaded tree."""
        registry, wanted = self.tree.registry, None
        source, search_path = (loaded, ()) if isinstance(loaded, Path) else (loaded.origin or ("", ()))
        if isinstance(loaded, Tree):
            registry, wanted = loaded.registry, loaded.tree_id
            if loaded.origin is None:
                self._report(node, f"'{wanted}' was made in Python; give SubTree the function that makes its nodes")
                raise TreeLoadError(self.problems)
        documents = read_documents(source, search_path)
        main = main_tree_of(documents, wanted)
        check_documents(documents, registry, ScriptCompiler(registry.enums), main)
        raise_if_any(documents.problems)
        assert main is not None
        node.tree_id = main
        definition = documents.trees[main]
        inner = self._enter(node, place, definition.file)
        outer, self.documents = self.documents, documents
        child = self.build(definition.element.children[0], inner, depth)
        self.documents = outer
        child.parent = node
        if isinstance(loaded, Tree):
            for key, value in loaded.blackboard.items():
                if key not in node.attributes and value is not None:
                    inner.board.local_slot(key).assign(value)
        return child

    def _check(self, node: Node, info: NodeInfo) -> None:
        def report(field: str, message: str, suggestion: str) -> None:
            assert node.place is not None
            self.problems.append(TreeProblem(node.place.file, node.line, node.type_id, field, message, suggestion))

        count = len(node.children)
        if not isinstance(node, PyTreesBehaviour) and (
            count < info.min_children or (info.max_children is not None and count > info.max_children)
        ):
            wanted = f"at least {info.min_children}" if info.max_children is None else f"{info.max_children}"
            report("", f"it has {count} children but needs {wanted}", "")
        check_values(info, node.attributes, self.tree.registry, self.tree.compiler, report)

    def _where_made(self, node: Node, place: NodePlace) -> NodePlace:
        """Return the place, with the file that has made the node, where that is known."""
        if not node.line:
            return place
        file = named_from(self.tree.file, node.made_in)
        if file == place.file:
            return place
        return self._places.setdefault(
            (place, file), NodePlace(place.tree, place.board, place.path, place.ancestors, file)
        )

    def _enter(self, node: SubTree, place: NodePlace, file: str) -> NodePlace:
        if node.tree_id in place.ancestors:
            self._report(node, f"the tree '{node.tree_id}' contains itself")
            raise TreeLoadError(self.problems)
        ports = {k: v for k, v in node.attributes.items() if k[0] != "_" and k not in _SUBTREE_RESERVED}
        autoremap = node.attributes.get("_autoremap") in (True, "true", "1")
        return self.enter(node, node.named, ports, autoremap, place, file)


def _port_name(key: str) -> str:
    """Return the port that a keyword argument means; ``if_`` and ``else_`` stand for Python's own words."""
    return key[:-1] if key in ("if_", "else_") else key
