"""Trees of other BehaviorTree.CPP processes, opened with placeholders for unknown nodes and trees.

SubTrees are searched in the file and its includes, then in its package.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from bestman_bt.engine.building import Gaps, LoadOptions, load_documents, without_garbage_collection
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.loading import load_tree
from bestman_bt.engine.models.node_models import (
    Models,
    is_placeholder,
    model_info,
    node_name,
    placeholder,
    seen_ports,
    with_foreign,
)
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.xml.checking import Checker
from bestman_bt.engine.xml.documents import Documents, TreeDefinition, read_documents
from bestman_bt.engine.xml.elements import Element

if TYPE_CHECKING:
    from bestman_bt.engine.substitution import SubstitutionRules


class OpenOptions(LoadOptions, total=False):
    """Arguments of ``load_tree`` that ``open_tree`` passes on."""

    main_tree: str | None
    substitutions: SubstitutionRules | None
    faults: list[TreeProblem] | None


def open_tree(
    source: str | Path,
    registry: NodeRegistry | None = None,
    *,
    package: Package | None = None,
    search_path: Iterable[Path] = (),
    gaps: Gaps | None = None,
    **options: Unpack[OpenOptions],
) -> Tree:
    """Load a tree as ``load_tree`` does, with placeholders for unknown nodes, ports and trees.

    ``gaps`` records unknown nodes and trees; ``package`` provides SubTrees and models that the file lacks. If a file
    holds several trees and names no main tree, the first tree that no other one uses is taken.

    Raises:
        TreeLoadError: as ``load_tree`` does, for faults in every BehaviorTree.CPP.
    """
    path = str(source)
    if not path.lstrip("\ufeff \t\r\n").startswith("<") and Path(path).suffix == ".py":
        return load_tree(source, registry, **options)
    folders = tuple(search_path)
    with without_garbage_collection():
        documents = read_documents(source, folders)
        if package is not None:
            package.complete(documents)
        options["main_tree"] = options.get("main_tree") or main_of(documents)
        models = package.models if package is not None else {}
        tree = open_documents(documents, registry or NodeRegistry(), models, gaps, **options)
        tree.origin = (source, folders)
        return tree


def open_documents(
    documents: Documents,
    registry: NodeRegistry,
    models: Models,
    gaps: Gaps | None = None,
    **options: Unpack[OpenOptions],
) -> Tree:
    """Build a tree from documents as ``open_tree`` does; ``options`` are those of ``load_documents``."""
    return load_documents(documents, with_foreign(registry, documents, models), gaps=gaps or Placeholders(), **options)


def main_of(documents: Documents) -> str | None:
    """Return the tree to show: ``main_tree_to_execute``, else the first tree of the file that no other one uses."""
    if documents.main_tree is not None or len(documents.trees) < 2:
        return None
    roots = documents.unused_trees()
    return roots[0] if roots else next(iter(documents.trees))


def missing_nodes(tree: Tree) -> dict[str, NodeInfo]:
    """Return the types of a tree's nodes that have no code here, by name."""
    return {node.type_id: node.info for node in tree.nodes if is_placeholder(node) and node.info is not None}


class Placeholders(Gaps):
    """Inserts placeholders for unknown parts."""

    suggests = False

    def fill(self, checker: Checker) -> None:
        """Replace each node without code, or with unknown ports, by a placeholder of its type, and each missing tree by
        a placeholder tree."""
        documents = checker.documents
        for element in checker.misfits:
            if element.tag == "SubTree":
                tree_id = element.attributes["ID"]
                documents.trees.setdefault(tree_id, _empty_tree(tree_id, documents.file, element.line))
            elif element.info is not None:
                element.info = _fitting(element.info, element)
                element.entries = [
                    (key, entry, Any)
                    for key, text in element.attributes.items()
                    if key in element.info.ports and (entry := key_of(text, key)) is not None
                ] or None


class StrictPlaceholders(Placeholders):
    """Placeholders for nodes and trees without code. Faults of nodes with code are errors, unless a TreeNodesModel, of
    the file or among ``models``, declares a node of this name with other ports.
    """

    suggests = True

    def __init__(self, models: Models) -> None:
        super().__init__()
        self._models = models
        self._own: set[str] = set()

    def fill(self, checker: Checker) -> None:
        """Exclude the misfits that are errors."""
        of_file = {info.name: info for one in checker.documents.node_models if (info := model_info(*one))}
        declared = {**self._models, **of_file}
        self._own = {
            info.name
            for info in checker.registry
            if not (info.builtin or info.known_from) and declared.get(info.name, info).ports.keys() == info.ports.keys()
        }
        checker.misfits[:] = [element for element in checker.misfits if node_name(element) not in self._own]
        super().fill(checker)

    def take(self, problems: list[TreeProblem]) -> None:
        """Record the problems that are not errors."""
        problems[:] = [replace(one, missing=False) if one.node in self._own else one for one in problems]
        super().take(problems)


def _fitting(info: NodeInfo, element: Element) -> NodeInfo:
    """Return a placeholder that takes the ports and children that an element has."""
    kind, count = info.kind, len(element.children)
    if count and kind in ("Action", "Condition"):
        kind = "Decorator" if count == 1 else "Control"
    elif kind == "Decorator" and count != 1:
        kind = "Control" if count else "Action"
    seen = {port.name: port for port in seen_ports([element])}
    ports = [replace(port, data_type=Any, required=False, bounds=None) for port in info.ports.values()]
    return placeholder(
        info.name,
        kind,
        [*ports, *(port for name, port in seen.items() if name not in info.ports)],
        info.known_from or "the registry, where it has other ports or children",
        info.description,
    )


def _empty_tree(tree_id: str, file: str, line: int) -> TreeDefinition:
    """Return a tree of one placeholder, for an unknown tree."""
    node = Element(tree_id, {"name": f"{tree_id} (not found)"}, line)
    node.info = placeholder(tree_id, "SubTree", (), "the SubTree that names it")
    element = Element("BehaviorTree", {"ID": tree_id}, line)
    element.children = [node]
    return TreeDefinition(tree_id, element, file)
