"""Checks of a tree file without running it: every error that loading would report, and warnings beyond.

Warnings: entries that are read but never written, children that can never be ticked, SubTree ports that shadow an outer
entry, unused trees, attributes that look like misspelt scripts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

from bestman_bt.engine import controls, decorators
from bestman_bt.engine.building import main_tree_of
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.core.strict_order import STRICT, upwards
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.coverage import unreachable_children
from bestman_bt.engine.dataflow import SCRIPT_ATTRIBUTES, EntryUse, entry_uses
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.leaves.base import Condition, StatefulAction
from bestman_bt.engine.leaves.native import PyTreesBehaviour
from bestman_bt.engine.loading import load_tree
from bestman_bt.engine.models.foreign import StrictPlaceholders, main_of, open_documents
from bestman_bt.engine.models.node_models import is_placeholder
from bestman_bt.engine.models.package import Package, subtree_ids
from bestman_bt.engine.spelling import closest
from bestman_bt.engine.unwritten import SubTrees, UnwrittenRead, problem_at, unwritten_reads
from bestman_bt.engine.xml.documents import Documents, read_documents

_REACTIVE = (controls.ReactiveSequence, controls.ReactiveFallback)
_KNOWN_ATTRIBUTES = frozenset((*SCRIPT_ATTRIBUTES, STRICT, "_autoremap", "_description", "_uid", "_fullpath"))


def validate_file(
    path: str | Path,
    registry: NodeRegistry | None = None,
    *,
    search_path: Iterable[Path] = (),
    given: Iterable[str] | None = (),
    package: Package | None = None,
) -> list[TreeProblem]:
    """Return all errors and warnings of a tree file.

    Problems with ``missing`` set may be valid in another BehaviorTree.CPP process. Faults of nodes in ``registry`` are
    among these only if a TreeNodesModel declares other ports for them.

    Args:
        path: an XML file or a Python file with ``build()``.
        registry: the nodes that it may name.
        search_path: folders that it may include from.
        given: root entries set before the tree runs; None: do not report entries that are read before they are written.
        package: other files with its SubTrees and models of nodes.
    """
    registry = registry or NodeRegistry()
    found: list[TreeProblem] = []
    models = {} if package is None else package.models
    gaps = StrictPlaceholders(models)
    documents = None
    try:
        if Path(path).suffix == ".py":
            tree = load_tree(path, registry, faults=found)
        else:
            documents = read_documents(path, search_path)
            if documents.old:
                return documents.old
            main = main_tree_of(documents, None)
            if main is None and documents.node_models and not documents.trees:
                return []  # a file of models
            if package is not None:
                package.complete(documents)
            shown = main or main_of(documents)
            found.extend(_unused_circles(documents, shown))
            tree = open_documents(documents, registry, models, gaps, faults=found, main_tree=shown)
            if main is not None:
                found.extend(_unused_trees(documents, main, package))
    except TreeLoadError as error:
        found += error.problems
        return _sorted([*found, *gaps.problems, *(documents.problems if documents is not None else ())])
    found += [*gaps.problems, *(documents.problems if documents is not None else ())]
    if any(problem.severity != "warning" for problem in found):
        reported = {(problem.file, problem.line, problem.field) for problem in found}
        reads = [read.problem("warning") for read in _reads(tree, given) if read.key not in tree.faulty_names]
        found += [problem for problem in reads if (problem.file, problem.line, problem.field) not in reported]
    else:
        found.extend(tree_warnings(tree, given))
        found += [
            _warning(node, "", "not portable: BehaviorTree.CPP has no leaves of py_trees")
            for node in tree.nodes
            if isinstance(node, PyTreesBehaviour) and not node.children
        ]
    return _sorted(found)


def tree_warnings(tree: Tree, given: Iterable[str] | None = ()) -> list[TreeProblem]:
    """Return the warnings of a tree that loads; ``given`` as in ``validate_file``."""
    return [*(read.problem("warning") for read in _reads(tree, given)), *ineffective_parts(tree)]


def _reads(tree: Tree, given: Iterable[str] | None) -> Iterable[UnwrittenRead]:
    return () if given is None else unwritten_reads(tree, given)


def ineffective_parts(tree: Tree) -> list[TreeProblem]:
    """Return warnings about parts without effect: unread attributes, nodes that are never ticked."""
    uses = entry_uses(tree)
    written = {id(use.slot) for use in uses if use.writes}
    found = [*_shadowing(tree, written), *_misspelt(tree), *_unread(tree)]
    found.extend(_lost_writes(tree, uses))
    never = [node for node in tree.nodes if isinstance(node, decorators.Timeout)]
    never = [node for node in never if str(node.attributes.get("msec")) == "0"]
    found += [_warning(node, "msec", "0 means that it never times out") for node in never]
    found.extend(_unfit_below_reactive(tree))
    for child, sibling in unreachable_children(tree):
        message = f"it can never be ticked: the earlier child '{sibling.name}' always ends or blocks the parent"
        found.append(_warning(child, "", message))
    return found


def _sorted(problems: list[TreeProblem]) -> list[TreeProblem]:
    return sorted(dict.fromkeys(problems), key=lambda problem: (problem.file, problem.line))


def _warning(node: Node, field: str, message: str, suggestion: str = "") -> TreeProblem:
    file = "" if node.place is None else node.place.file
    return TreeProblem(file, node.line, node.type_id, field, message, suggestion, "warning")


def _unused_circles(documents: Documents, shown: str | None) -> Iterator[TreeProblem]:
    """Yield each circle of trees that the shown tree does not use; its own circles are found when it is built."""
    used = set() if shown is None else documents.used_trees(shown)
    done = {id(documents.trees[key]) for key in used}
    for start in documents.trees.values():
        route = [] if id(start) in done else [start]
        pending = [iter(subtree_ids(one)) for one in route]
        on_route = set(map(id, route))
        while route:
            tree_id = next(pending[-1], None)
            found = None if tree_id is None else documents.find(tree_id, route[-1].file)
            if tree_id is None:
                pending.pop()
                left = id(route.pop())
                on_route.discard(left)
                done.add(left)
            elif found is not None and id(found) in on_route:
                circle = [*route[next(i for i, one in enumerate(route) if one is found) :], found]
                message = f"the trees include each other recursively: {' -> '.join(one.tree_id for one in circle)}"
                line = found.element.line
                yield TreeProblem(found.file, line, "BehaviorTree", "ID", message, severity="latent")
            elif found is not None and id(found) not in done:
                route.append(found)
                pending.append(iter(subtree_ids(found)))
                on_route.add(id(found))


def _unused_trees(documents: Documents, main: str, package: Package | None) -> Iterator[TreeProblem]:
    users = {} if package is None else package.user_files
    entered = [main, *(tree_id for tree_id in documents.trees if users.get(tree_id, set()) - {documents.file})]
    used = {name for tree_id in entered for name in documents.used_trees(tree_id)}
    for tree_id, definition in documents.trees.items():
        if tree_id not in used and definition.file == documents.file:
            line = definition.element.line
            yield TreeProblem(
                definition.file, line, "BehaviorTree", "ID", f"tree '{tree_id}' is never used", "", "warning"
            )


def _shadowing(tree: Tree, written: set[int]) -> Iterator[TreeProblem]:
    for node in tree.nodes:
        if not isinstance(node, SubTree) or str(node.attributes.get("_autoremap")).lower() not in ("true", "1"):
            continue
        for port, value in node.attributes.items():
            if port in ("ID", "name") or port[0] == "_" or key_of(value, port) is not None:
                continue
            if id(node.board.slot(port)) in written:
                message = "the literal shadows the outer entry of this name, which _autoremap would share"
                yield _warning(node, port, message)


def _unfit_below_reactive(tree: Tree) -> Iterator[TreeProblem]:
    """Yield problems of leaves that a reactive node repeats or interrupts although they do not support it."""
    for node in tree.nodes:
        if STRICT in node.attributes and not isinstance(node, _REACTIVE):
            yield _warning(node, STRICT, "it only affects ReactiveSequence and ReactiveFallback")
        if node.children or is_placeholder(node) or not any(isinstance(above, _REACTIVE) for above in upwards(node)):
            continue
        kind: Any = type(node)
        if isinstance(node, Condition):
            if isinstance(kind.on_tick, FunctionType) and "RUNNING" in kind.on_tick.__code__.co_names:
                yield _warning(node, "", "a condition that may return RUNNING blocks the reactive node above it")
        elif isinstance(node, StatefulAction) and kind.on_halted is StatefulAction.on_halted:
            yield _warning(node, "", "a reactive node may halt it, and it does not define on_halted()")


def _unread(tree: Tree) -> Iterator[TreeProblem]:
    subtrees = SubTrees(tree)
    for node in tree.nodes:
        if not isinstance(node, SubTree):
            continue
        for port in subtrees.unread_ports(node):
            hint = closest(port, subtrees.used_in(node))
            message = f"nothing in the tree '{node.tree_id}' uses it"
            yield problem_at(node, port, message, f"did you mean '{hint}'?" if hint else "", "warning")


def _lost_writes(tree: Tree, uses: list[EntryUse]) -> Iterator[TreeProblem]:
    for use in uses:
        outer = use.node.board.remapping.get(use.key, "")
        if use.writes and outer[:1] == "@":
            message = f"its writes to '{{{use.key}}}' do not reach '{outer}', to which the SubTree maps it"
            yield _warning(use.node, use.port, message, f"write to '{{{outer}}}' itself")


def _misspelt(tree: Tree) -> Iterator[TreeProblem]:
    for node in tree.nodes:
        for attribute in node.attributes:
            if attribute[0] == "_" and attribute not in _KNOWN_ATTRIBUTES:
                hint = closest(attribute, _KNOWN_ATTRIBUTES)
                if hint:
                    message = "it is not a script attribute and has no effect"
                    yield _warning(node, attribute, message, f"did you mean '{hint}'?")
