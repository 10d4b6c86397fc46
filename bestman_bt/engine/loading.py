"""Loading: from a file, XML or Python, or from XML text to a ``Tree``."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Unpack

from py_trees.behaviour import Behaviour

from bestman_bt.engine.authoring import build_tree
from bestman_bt.engine.blackboard import forget_dropped_trees
from bestman_bt.engine.building import LoadOptions, load_documents, without_garbage_collection
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.leaves.native import creation_lines_recorded
from bestman_bt.engine.own_files import described, importable, load_file
from bestman_bt.engine.xml.documents import read_documents

if TYPE_CHECKING:
    from bestman_bt.engine.models.package import Package
    from bestman_bt.engine.substitution import SubstitutionRules


def load_tree(
    source: str | Path,
    registry: NodeRegistry | None = None,
    *,
    main_tree: str | None = None,
    search_path: Iterable[Path] = (),
    substitutions: SubstitutionRules | None = None,
    faults: list[TreeProblem] | None = None,
    package: Package | None = None,
    **options: Unpack[LoadOptions],
) -> Tree:
    """Load a tree from a file (``.xml``, or ``.py`` that defines ``build() -> Node``) or from XML text.

    Args:
        source: a path, or text that begins with ``<``.
        registry: the nodes that the file may name; the built-in ones by default.
        main_tree: the tree to run, if the file holds several; overrides ``main_tree_to_execute``.
        search_path: folders that ``<include>`` may use besides the file's own.
        substitutions: nodes to replace, for tests.
        faults: receives the errors of the tree, including those of a later tick; faulty parts are omitted, so that the
            rest can be checked. Do not tick a tree that has errors. package: other files that contain SubTrees.
        options: ``context``, ``clock`` and ``blackboard``, see ``LoadOptions``.

    Raises:
        TreeLoadError: listing every fault in ``problems``; with ``faults``, only if no tree is left.
    """
    if isinstance(source, Path) or not source.lstrip("\ufeff \t\r\n").startswith("<"):
        path = Path(source)
        if path.suffix == ".py":
            return build_tree(
                load_python_tree(path), registry=registry, substitutions=substitutions, tree_id=path.stem,
                file=str(path), faults=faults, **options,
            )  # fmt: skip
    folders = tuple(search_path)
    with without_garbage_collection():
        documents = read_documents(source, folders)
        if package is not None:
            if len(documents.trees) == 1:
                main_tree = main_tree or next(iter(documents.trees))
            package.complete(documents)
        tree = load_documents(
            documents, registry or NodeRegistry(), main_tree=main_tree,
            substitutions=substitutions, faults=faults, **options,
        )  # fmt: skip
        tree.origin = (source, folders)
        return tree


def load_python_tree(path: Path) -> Behaviour:
    """Return the result of ``build()`` of a Python file: a node, a native py_trees behaviour, or a loaded tree.

    While it runs, the modules in the same folder can be imported.

    Raises:
        TreeLoadError: the file does not exist, fails to run or ends the program, or defines no ``build()``.
    """

    def fail(message: str, line: int = 0) -> TreeLoadError:
        return TreeLoadError([TreeProblem(str(path), line, "", "", message)])

    if not path.is_file():
        raise fail("the tree file does not exist")
    name = f"bestman_bt_tree_{path.stem}"
    forget_dropped_trees()
    try:
        with importable(path.parent), creation_lines_recorded():
            build = getattr(load_file(path, name), "build", None)
            if not callable(build):
                raise fail("it defines no function build() that returns the root node")
            root = build()
    except TreeLoadError:
        raise
    except (Exception, SystemExit) as error:
        file, line, words = described(error, path)
        raise TreeLoadError([TreeProblem(file, line, "", "", f"it fails with {words}")]) from error
    finally:
        sys.modules.pop(name, None)
    if isinstance(root, Tree):
        return root.as_subtree()
    if not isinstance(root, Behaviour):
        line = build.__code__.co_firstlineno if isinstance(build, FunctionType) else 0
        raise fail(f"its build() returned {root!r}; a node is expected", line)
    return root
