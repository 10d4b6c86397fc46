"""Checks a tree file without running it: every error that loading would report, and warnings beyond."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bestman_bt.engine.errors import Problem, TreeLoadError
from bestman_bt.engine.loading import check_documents, load_tree, main_tree_of
from bestman_bt.engine.registry import NodeRegistry
from bestman_bt.engine.scripting import ScriptCompiler
from bestman_bt.engine.xml.documents import read_documents


def validate_file(
    path: str | Path, registry: NodeRegistry | None = None, *, search_path: Iterable[Path] = ()
) -> list[Problem]:
    """Return everything that is wrong with a tree file; empty where nothing is.

    A file that only holds subtrees, for others to include, is checked too.
    """
    registry = registry or NodeRegistry()
    if Path(path).suffix == ".py":
        try:
            load_tree(path, registry)
        except TreeLoadError as error:
            return error.problems
        return []
    try:
        documents = read_documents(path, search_path)
    except TreeLoadError as error:
        return error.problems
    check_documents(documents, registry, ScriptCompiler(registry.enums))
    main = main_tree_of(documents, None)
    if not documents.problems and main is not None:
        try:
            load_tree(path, registry, search_path=search_path)
        except TreeLoadError as error:
            return error.problems
    return sorted(documents.problems, key=lambda problem: (problem.file, problem.line))
