"""Packages of trees: files that use each other's SubTrees by ID, like one BehaviorTree.CPP process that loads all.

A package is a folder, a project of Groot2 (``.btproj``), a file, or several of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from bestman_bt.engine.core.registry import NodeInfo
from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.models.node_models import Models, model_info
from bestman_bt.engine.spelling import closest
from bestman_bt.engine.xml.documents import Documents, TreeDefinition, read_documents, read_file, read_root
from bestman_bt.engine.xml.elements import Element, parse_xml

MAX_FILES: Final = 5_000
"""Largest number of XML files in a package."""
MOST_NAMES: Final = 20
"""Largest number of trees that a message lists."""
_SKIPPED: Final = frozenset(("build", "install", "log", "node_modules", "__pycache__"))


@dataclass
class Package:
    """The files of a package, as read; ``problems``: of unreadable files, and of models.

    ``others``: number of XML files without trees or node models.
    """

    files: dict[str, Documents] = field(default_factory=dict)
    problems: list[TreeProblem] = field(default_factory=list)
    models: dict[str, NodeInfo] = field(default_factory=dict)
    others: int = 0

    @classmethod
    def open(cls, paths: Iterable[str | Path], search_path: Iterable[Path] = ()) -> Package:
        """Read all tree files of folders, projects and files.

        Raises:
            TreeLoadError: a path does not exist, or holds too many files.
        """
        package, folders = cls(), tuple(search_path)
        for path in map(Path, paths):
            if path.is_dir():
                count = len(package.files) + len(package.problems)
                for file in _tree_files(path):
                    package._read(file, (*folders, path), named=False)
                if len(package.files) + len(package.problems) == count:
                    package.problems.append(TreeProblem(str(path), 0, "", "", "there are no tree files in the folder"))
            elif path.suffix == ".btproj":
                package._read_project(path, folders)
            else:
                package._read(path, folders, named=True)
        package.models.update(known_models(package.files.values(), package.problems))
        return package

    def definitions(self, tree_id: str) -> list[TreeDefinition]:
        """Return the definitions of a tree, in the order of the files."""
        return self._by_id.get(tree_id, [])

    def trees(self) -> Iterator[TreeDefinition]:
        """Yield every tree of the package."""
        for found in self._by_id.values():
            yield from found

    def file_of(self, tree_id: str, package: str) -> str:
        """Return the file that defines a tree; ``package``: the name of the package in messages.

        Raises:
            TreeLoadError: no file defines it, or several do.
        """
        found = self.definitions(tree_id)
        if len(found) != 1:
            hint = closest(tree_id, self._by_id)
            places = ", ".join(f"{one.file}:{one.element.line}" for one in found)
            message = f"the tree '{tree_id}' is defined twice: {places}" if found else f"there is no tree '{tree_id}'"
            suggestion = "" if found else f"did you mean '{hint}'?" if hint else f"its trees: {self.tree_names()}"
            raise TreeLoadError([TreeProblem(package, 0, "", "", message, suggestion)])
        return found[0].file

    def tree_names(self) -> str:
        """Return the IDs of its trees as text, at most ``MOST_NAMES``, those first that no other tree names."""
        names = list(dict.fromkeys(one.tree_id for one in (*self.roots(), *self.trees())))
        rest = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        return ", ".join(names[:MOST_NAMES]) + rest if names else "none"

    def refuse_broken(self) -> None:
        """Raise TreeLoadError if files could not be read."""
        if self.problems:
            raise TreeLoadError(self.problems)

    def duplicates(self) -> list[list[TreeDefinition]]:
        """Return the groups of trees that share an ID."""
        return [found for found in self._by_id.values() if len(found) > 1]

    @cached_property
    def user_files(self) -> dict[str, set[str]]:
        """Tree → the files with a SubTree that names it."""
        files: dict[str, set[str]] = {}
        for one in self.trees():
            for tree_id in subtree_ids(one):
                files.setdefault(tree_id, set()).add(one.file)
        return files

    def users(self) -> dict[str, Counter[str]]:
        """Return tree → the trees that its SubTrees name, with counts."""
        return {one.tree_id: Counter(subtree_ids(one)) for one in self.trees()}

    def unused(self) -> list[TreeDefinition]:
        """Return the trees that are neither named by another tree of the package nor the main tree of a file."""
        main = {(file, documents.main_tree) for file, documents in self.files.items()}
        return [one for one in self.roots() if (one.file, one.tree_id) not in main]

    def roots(self) -> list[TreeDefinition]:
        """Return the trees that are not named by another tree of the package."""
        uses = self.users()
        named = {inner for outer, inners in uses.items() for inner in inners if inner != outer}
        return [one for one in self.trees() if one.tree_id not in named]

    def complete(self, documents: Documents) -> None:
        """Add the trees of the package that a file's trees use.

        A SubTree is searched in its user's file first, then in ``documents``, then in the other files. If an ID is
        defined twice outside its user's file, this is an error and the first definition is used.
        """
        pending = list(documents.trees.values())
        while pending:
            user = pending.pop()
            for element in user.element.iter():
                tree_id = element.attributes.get("ID", "") if element.tag == "SubTree" else ""
                if not tree_id or (user.file, tree_id) in documents.scoped:
                    continue
                known = documents.trees.get(tree_id)
                found = self._choose(documents, user, element, tree_id, known)
                if found is not None and found is not known:
                    documents.add(found, user.file)
                    self._add_models(documents, found.file)
                    pending.append(found)

    def _choose(
        self, documents: Documents, user: TreeDefinition, element: Element, tree_id: str, known: TreeDefinition | None
    ) -> TreeDefinition | None:
        candidates = self.definitions(tree_id)
        own = [one for one in candidates if one.file == user.file]
        if own and known is not None and known.file not in (user.file, documents.file):
            return own[0]
        if known is not None and (known.file == user.file or user.file == documents.file or not own):
            return known
        if own:
            return own[0]
        if len(candidates) > 1:
            places = " and ".join(f"{one.file}:{one.element.line}" for one in candidates[:2])
            message = f"'{tree_id}' is defined twice, at {places}"
            documents.problems.append(TreeProblem(user.file, element.line, "SubTree", "ID", message))
        return candidates[0] if candidates else None

    def _add_models(self, documents: Documents, file: str) -> None:
        other = self.files.get(file)
        if other is not None and file not in documents.files:
            documents.files.append(file)
            for tree_id, ports in other.models.items():
                documents.models.setdefault(tree_id, ports)
            documents.node_models += other.node_models

    @property
    def _by_id(self) -> dict[str, list[TreeDefinition]]:
        if self._index is None:
            self._index = {}
            for file, documents in self.files.items():
                for one in (*documents.trees.values(), *documents.replaced):
                    if one.file == file:
                        self._index.setdefault(one.tree_id, []).append(one)
        return self._index

    _index: dict[str, list[TreeDefinition]] | None = None

    def _read(self, path: Path, search_path: tuple[Path, ...], *, named: bool) -> None:
        try:
            if not named and not _holds_trees(path):
                self.others += 1
                return
            self.files[str(path)] = read_documents(path, search_path)
        except TreeLoadError as error:
            self.problems += error.problems
        self._index = None

    def _read_project(self, path: Path, search_path: tuple[Path, ...]) -> None:
        project = Documents(str(path), "")
        root = parse_xml(read_file(path, str(path)), str(path), self.problems.append)
        includes = [element for element in root.children if element.tag == "include"]
        root.children = [element for element in root.children if element.tag != "include"]
        read_root(root, str(path), project)
        self.files[str(path)] = project
        for element in includes:
            file = path.parent / element.attributes.get("path", "")
            if file.is_file():
                self._read(file, (*search_path, path.parent), named=True)
            else:
                what = f"there is no file '{element.attributes.get('path', '')}'"
                self.problems.append(TreeProblem(str(path), element.line, "include", "path", what))


def known_models(files: Iterable[Documents], problems: list[TreeProblem]) -> Models:
    """Return the node descriptions of the files' TreeNodesModels; contradicting kinds are added to ``problems``."""
    models: dict[str, NodeInfo] = {}
    for documents in files:
        for element, file in documents.node_models:
            info = model_info(element, file)
            if info is None:
                continue
            known = models.setdefault(info.name, info)
            if known.kind != info.kind:
                message = f"its kind is {known.kind} at {known.known_from}, and {info.kind} here"
                problems.append(TreeProblem(file, element.line, info.name, "", message))
    return models


def subtree_ids(definition: TreeDefinition) -> list[str]:
    """Return the IDs that a tree's SubTrees name."""
    elements = definition.element.iter()
    return [tree_id for e in elements if e.tag == "SubTree" and (tree_id := e.attributes.get("ID"))]


def _tree_files(folder: Path) -> list[Path]:
    """Return the XML files below a folder, but for hidden folders and those of builds."""
    found: list[Path] = []
    pending = [folder]
    while pending:
        here = pending.pop()
        for path in sorted(here.iterdir()):
            if path.is_dir() and not path.is_symlink() and path.name[0] != "." and path.name not in _SKIPPED:
                pending.append(path)
            elif path.suffix == ".xml" and path.is_file():
                found.append(path)
        if len(found) > MAX_FILES:
            message = f"it holds more than {MAX_FILES} XML files; name a folder within it"
            raise TreeLoadError([TreeProblem(str(folder), 0, "", "", message)])
    return sorted(found)


def _holds_trees(path: Path) -> bool:
    """Return whether an XML file may be of BehaviorTree.CPP; also True for invalid XML, which reading reports."""
    with path.open("rb") as file:
        head = file.read(65_536)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    return b"<root" in head or b"<" not in head
