"""The files of one tree: a main document, its includes, trees and subtree models.

Files of py_trees (``py_trees.parsers.behaviour_tree_xml``, since 2.5) are read as the equivalent nodes of this engine:
they look like files of BehaviorTree.CPP, with other names for control nodes and decorators, which are case-insensitive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.xml.elements import MAX_BYTES, Element, parse_xml

MAX_INCLUDES = 200
_RESERVED = frozenset((
    "name", "ID", "_autoremap", "_failureIf", "_successIf", "_skipIf", "_while", "_onHalted", "_onSuccess",
    "_onFailure", "_post",
))  # fmt: skip
_FORBIDDEN = frozenset("<>&\"'/\\:*?|.")


@dataclass(frozen=True)
class TreeDefinition:
    """One ``<BehaviorTree>`` and its file."""

    tree_id: str
    element: Element
    file: str


@dataclass(frozen=True)
class ModelPort:
    """One port of a SubTree in a TreeNodesModel; mandatory without a default. ``type``: as written."""

    name: str
    direction: str
    default: str | None
    line: int
    type: str = ""


@dataclass(frozen=True)
class MetadataEntry:
    """A ``<Metadata key="text"/>`` of a SubTree, with its place."""

    text: str
    file: str
    line: int


@dataclass
class Documents:
    """Everything that was read for one tree, and the problems so far.

    ``metadata``: of the subtree models, key → ``<Metadata key="text"/>``. ``replaced``: trees whose ID is taken by
    another file, or a later tree of the same file. ``node_models``: node descriptions of the TreeNodesModels, as
    (element, file). ``scoped``: trees of an ID that is taken by another tree elsewhere, by file. ``old``: files of
    version 3, whose other problems are meaningless.
    """

    file: str
    source: str
    trees: dict[str, TreeDefinition] = field(default_factory=dict)
    replaced: list[TreeDefinition] = field(default_factory=list)
    models: dict[str, dict[str, ModelPort]] = field(default_factory=dict)
    node_models: list[tuple[Element, str]] = field(default_factory=list)
    scoped: dict[tuple[str, str], TreeDefinition] = field(default_factory=dict)
    metadata: dict[str, dict[str, MetadataEntry]] = field(default_factory=dict)
    main_tree: str | None = None
    problems: list[TreeProblem] = field(default_factory=list)
    old: list[TreeProblem] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    search_path: tuple[Path, ...] = ()

    def unused_trees(self) -> list[str]:
        """Return the IDs of the main file's trees that its other trees do not use."""
        own = [name for name, one in self.trees.items() if one.file == self.file]
        return [name for name in own if not any(name in self.used_trees(other) for other in own if other != name)]

    def find(self, tree_id: str, file: str) -> TreeDefinition | None:
        """Return the tree that a SubTree in ``file`` refers to."""
        return self.scoped.get((file, tree_id)) or self.trees.get(tree_id)

    def add(self, definition: TreeDefinition, user: str) -> None:
        """Add a tree of another file that the file ``user`` refers to."""
        known = self.trees.setdefault(definition.tree_id, definition)
        if known is not definition:
            self.trees[f"{definition.tree_id} of {definition.file}"] = definition
            self.scoped[user, definition.tree_id] = definition

    def used_trees(self, main: str) -> set[str]:
        """Return the keys of the trees that ``main`` uses, itself included."""
        keys = {id(one): key for key, one in self.trees.items()}
        used: set[str] = set()
        pending = [self.trees.get(main)]
        while pending:
            one = pending.pop()
            if one is not None and (key := keys.get(id(one), one.tree_id)) not in used:
                used.add(key)
                ids = (e.attributes.get("ID", "") for e in one.element.iter() if e.tag == "SubTree")
                pending.extend(self.find(tree_id, one.file) for tree_id in ids)
        return used


def read_documents(source: str | Path, search_path: Iterable[Path] = ()) -> Documents:
    """Read a tree file (or XML text) and its includes.

    Included files must lie in the folder of the tree file or in one of ``search_path``.

    Raises:
        TreeLoadError: a file cannot be read as XML.
    """
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        reader = _Reader(None, search_path)
        documents = Documents("<text>", source, search_path=tuple(search_path))
        reader.read(parse_xml(source, "<text>", documents.problems.append), "<text>", None, documents, main=True)
        return documents
    path = Path(source)
    data = read_file(path, str(path))
    documents = Documents(str(path), data.decode("utf-8", "replace"), search_path=tuple(search_path))
    reader = _Reader(path.resolve().parent, search_path)
    reader.open_files.append(path.resolve())
    reader.read(parse_xml(data, str(path), documents.problems.append), str(path), path.resolve(), documents, main=True)
    return documents


def read_file(path: Path, name: str) -> bytes:
    """Return the bytes of a tree file.

    Raises:
        TreeLoadError: it does not exist, is not a file, or is too large.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            what = f"the file has {path.stat().st_size} bytes; at most {MAX_BYTES} are accepted"
            raise TreeLoadError([TreeProblem(name, 0, "", "", what)])
        return path.read_bytes()
    except FileNotFoundError:
        raise TreeLoadError([TreeProblem(name, 0, "", "", "the tree file does not exist")]) from None
    except (OSError, ValueError) as error:
        raise TreeLoadError([TreeProblem(name, 0, "", "", f"the tree file cannot be read: {error}")]) from None


def read_root(root: Element, file: str, documents: Documents) -> None:
    """Add the trees and models of an outermost element; includes are not followed."""
    _Reader(None, ()).read(root, file, None, documents, main=True)


class _Reader:
    def __init__(self, folder: Path | None, search_path: Iterable[Path]) -> None:
        self.allowed = [*([folder] if folder is not None else []), *(Path(p).resolve() for p in search_path)]
        self.open_files: list[Path] = []
        self.done: set[Path] = set()
        self.of_py_trees = False

    def read(self, root: Element, file: str, path: Path | None, documents: Documents, *, main: bool) -> None:
        documents.files.append(file)
        report = documents.problems.append
        if root.tag != "root":
            report(TreeProblem(file, root.line, root.tag, "", "the outermost element must be <root>"))
            return
        self._read_format(root, file, documents)
        if main:
            documents.main_tree = root.attributes.get("main_tree_to_execute")
        for element in root.children:
            if element.tag == "include":
                self._include(element, file, path, documents)
        models = [element for element in root.children if element.tag == "TreeNodesModel"]
        for extra in models[1:]:
            report(TreeProblem(file, extra.line, extra.tag, "", "a file may contain only one <TreeNodesModel>"))
        for model in models:
            _read_models(model, file, documents)
        trees = [element for element in root.children if element.tag == "BehaviorTree"]
        for element in trees:
            _read_tree(element, file, documents, alone=len(trees) == 1, of_py_trees=self.of_py_trees)
        what = "it is ignored: only <BehaviorTree>, <TreeNodesModel> and <include> may appear under <root>"
        others = [e for e in root.children if e.tag not in ("include", "TreeNodesModel", "BehaviorTree")]
        documents.problems += [TreeProblem(file, e.line, e.tag, "", what, severity="warning") for e in others]

    def _read_format(self, root: Element, file: str, documents: Documents) -> None:
        """Report files of other formats than version 4; change those of py_trees and what they include."""
        report = documents.problems.append
        old = old_version(root, file)
        version = root.attributes.get("BTCPP_format", "4")
        if old is not None:
            documents.old.append(old)
            return
        if version != "4":
            report(TreeProblem(file, root.line, "root", "BTCPP_format", f"'{version}' is not supported; it must be 4"))
        sign = find_py_trees_element(root)
        if sign is not None:
            self.of_py_trees = True
            what = "the file is in the format of py_trees: its nodes are read as those here that mean the same"
            report(TreeProblem(file, sign.line, sign.tag, "", what, severity="warning"))
        if self.of_py_trees:
            convert_to_own_nodes(root)

    def _include(self, element: Element, file: str, path: Path | None, documents: Documents) -> None:
        def report(message: str, field_name: str = "path", *, missing: bool = False) -> None:
            documents.problems.append(TreeProblem(file, element.line, "include", field_name, message, missing=missing))

        if "ros_pkg" in element.attributes:
            report("ROS packages are not looked up; give a path", "ros_pkg", missing=True)
            return
        target = element.attributes.get("path")
        if not target:
            report("the attribute is missing")
            return
        found = self._find(target, path)
        if found is None:
            report(
                f"'{target}' is not a file in the tree's folder or the search path",
                missing=True,
            )
            return
        if found in self.open_files:
            report(f"'{target}' includes itself, directly or through another file")
            return
        if found in self.done:
            return
        if len(self.done) + len(self.open_files) >= MAX_INCLUDES:
            report(f"more than {MAX_INCLUDES} files are included")
            return
        self.open_files.append(found)
        try:
            name = str(found)
            self.read(
                parse_xml(read_file(found, name), name, documents.problems.append), name, found, documents, main=False
            )
        except TreeLoadError as error:
            documents.problems.extend(error.problems)
        finally:
            self.open_files.pop()
            self.done.add(found)

    def _find(self, target: str, including: Path | None) -> Path | None:
        bases = [including.parent] if including is not None else []
        for base in [*bases, *self.allowed]:
            try:
                candidate = (base / target).resolve()
                if candidate.is_file() and any(candidate.is_relative_to(folder) for folder in self.allowed):
                    return candidate
            except (OSError, ValueError):
                continue
        return None


def bad_character(name: str) -> str:
    """Return the first character that a name of a tree or port must not contain, or an empty text."""
    return next((c for c in name if c in _FORBIDDEN or ord(c) < 32 or ord(c) == 127), "")


def _read_tree(element: Element, file: str, documents: Documents, *, alone: bool, of_py_trees: bool) -> None:
    report = documents.problems.append
    tree_id = element.attributes.get("ID", "")
    if not tree_id:
        if not alone:
            report(TreeProblem(file, element.line, "BehaviorTree", "ID", "the attribute is missing"))
            return
        tree_id = "BehaviorTree_0"
    bad = bad_character(tree_id)
    if bad or tree_id in ("root", "Root"):
        what = f"'{tree_id}' cannot be the name of a tree" + (f" (it contains {bad!r})" if bad else "")
        report(TreeProblem(file, element.line, "BehaviorTree", "ID", what))
    known = documents.trees.get(tree_id)
    if known is not None:
        documents.replaced.append(known)
        if known.file == file:
            what = f"'{tree_id}' is also the ID of the tree in line {known.element.line}; rename one of them"
            report(TreeProblem(file, element.line, "BehaviorTree", "ID", what))
        else:
            where = f"{known.file}:{known.element.line}"
            what = f"'{tree_id}' is already defined at {where}; this later definition is used"
            report(TreeProblem(file, element.line, "BehaviorTree", "ID", what, severity="warning"))
    if len(element.children) != 1:
        what = f"tree '{tree_id}' must have exactly one root node but has {len(element.children)}"
        report(TreeProblem(file, element.line, "BehaviorTree", "", what))
    documents.trees[tree_id] = TreeDefinition(tree_id, element, file)
    defaults = {key: value for key, value in element.attributes.items() if key != "ID" and key[0] != "_"}
    for port, value in defaults.items() if of_py_trees else ():
        documents.models.setdefault(tree_id, {})[port] = ModelPort(port, "inout", value, element.line)


def _read_models(model: Element, file: str, documents: Documents) -> None:
    for element in model.children:
        if element.tag != "SubTree":
            documents.node_models.append((element, file))
            continue
        tree_id = element.attributes.get("ID")
        if tree_id is None:
            documents.problems.append(TreeProblem(file, element.line, element.tag, "ID", "the attribute is missing"))
            continue
        ports = documents.models.setdefault(tree_id, {})
        documents.metadata[tree_id] = {
            key: MetadataEntry(text, file, entry.line)
            for entry in element.iter()
            if entry.tag == "Metadata"
            for key, text in entry.attributes.items()
        }
        for port in element.children:
            name = port.attributes.get("name")
            if not port.tag.endswith("_port"):
                continue
            if not name:
                documents.problems.append(TreeProblem(file, port.line, port.tag, "name", "the attribute is missing"))
                continue
            if name[0].isdigit() or bad_character(name) or " " in name or name in _RESERVED:
                documents.problems.append(
                    TreeProblem(file, port.line, port.tag, "name", f"'{name}' is not a port name")
                )
                continue
            default = port.attributes.get("default") or None
            kind = port.attributes.get("type", "")
            ports[name] = ModelPort(name, port.tag.removesuffix("_port"), default, port.line, kind)


RENAMED: Final = {
    "SequenceStar": "SequenceWithMemory",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
    "SubTreePlus": "SubTree",
}
SIGNS: Final = frozenset((*RENAMED, *(f"BlackboardCheck{kind}" for kind in ("Int", "Double", "String", "Bool"))))
_SIGN_ATTRIBUTES: Final = ("__shared_blackboard", "__autoremap")
_SIGNS_OF_PARALLEL: Final = ("success_threshold", "failure_threshold", "threshold")


def old_version(root: Element, file: str) -> TreeProblem | None:
    """Return a problem if a file is of version 3, or None."""
    version = root.attributes.get("BTCPP_format")
    if version == "4":
        return None
    sign = "BTCPP_format" if version == "3" else ""
    line = root.line
    trees = [tree for tree in root.children if tree.tag == "BehaviorTree"] if not sign else []
    for element in (element for tree in trees for element in tree.iter()):
        names = {element.tag, element.attributes.get("ID", ""), *element.attributes}
        parallel = _SIGNS_OF_PARALLEL if "Parallel" in names else ()
        found = [name for name in (*SIGNS, *_SIGN_ATTRIBUTES, *parallel) if name in names]
        if found:
            sign, line = found[0], element.line
            break
    if not sign:
        return None
    message = f"the file is in the format of BehaviorTree.CPP 3 ('{sign}')"
    return TreeProblem(file, line, "", "", message, f"convert it with: bestman-bt convert {file}")


Change = Callable[[Element], tuple[str, dict[str, str]] | None]
"""Returns the equivalent tag and ports; None if there is no equivalent node."""


def _with_memory(remembers: str, reactive: str) -> Change:
    def change(element: Element) -> tuple[str, dict[str, str]]:
        return (remembers if element.attributes.get("memory", "true").lower() == "true" else reactive), {}

    return change


def _parallel(element: Element) -> tuple[str, dict[str, str]] | None:
    counts = {"success_on_one": "1", "success_on_all": "-1"}
    needed = counts.get(element.attributes.get("policy", "success_on_one"))
    return None if needed is None else ("Parallel", {"success_count": needed, "failure_count": "1"})


def _timeout(element: Element) -> tuple[str, dict[str, str]] | None:
    try:
        return "Timeout", {"msec": str(round(1000 * float(element.attributes.get("duration", "5.0"))))}
    except (ValueError, OverflowError):
        return None


def _counted(tag: str, port: str, named: str) -> Change:
    return lambda element: (tag, {port: element.attributes.get(named, "")})


def _plain(tag: str) -> Change:
    return lambda element: (tag, {})


_CHANGES: Final[dict[str, tuple[tuple[str, ...], Change]]] = {
    "sequence": (("memory",), _with_memory("Sequence", "ReactiveSequence")),
    "selector": (("memory",), _with_memory("Fallback", "ReactiveFallback")),
    "fallback": (("memory",), _with_memory("Fallback", "ReactiveFallback")),
    "parallel": (("policy",), _parallel),
    "inverter": ((), _plain("Inverter")),
    "failureissuccess": ((), _plain("ForceSuccess")),
    "successisfailure": ((), _plain("ForceFailure")),
    "successisrunning": ((), _plain("KeepRunningUntilFailure")),
    "retry": (("num_failures",), _counted("RetryUntilSuccessful", "num_attempts", "num_failures")),
    "repeat": (("num_success",), _counted("Repeat", "num_cycles", "num_success")),
    "timeout": (("duration",), _timeout),
}
"""Lower-case tag → the ports in py_trees, and the equivalent node here."""
_SIGNS: Final = frozenset((
    "selector", "failureissuccess", "successisfailure", "successisrunning", "failureisrunning", "runningisfailure",
    "runningissuccess", "retry", "oneshot", "statustoblackboard", "passthrough",
))  # fmt: skip
"""Lower-case tags that BehaviorTree.CPP does not have."""


def find_py_trees_element(root: Element) -> Element | None:
    """Return the first element that only a file of py_trees has, or None."""
    return None if "BTCPP_format" in root.attributes else next(_signs(root), None)


def convert_to_own_nodes(root: Element) -> None:
    """Convert nodes and ports of a py_trees file to those of this engine, in place."""
    for child in root.children:
        if child.tag.lower() in ("import", "include"):
            child.tag = "include"
            child.attributes = {"path": child.attributes.get("src") or child.attributes.get("file") or ""}
    for element in _nodes(root):
        ports, change = _CHANGES.get(element.tag.lower(), ((), None))
        changed = None if change is None else change(element)
        if changed is not None:
            kept = {key: value for key, value in element.attributes.items() if key not in ports}
            element.tag, element.attributes = changed[0], {**kept, **changed[1]}


def _nodes(root: Element) -> Iterator[Element]:
    return (element for tree in root.children if tree.tag == "BehaviorTree" for element in tree.iter())


def _signs(root: Element) -> Iterator[Element]:
    yield from (child for child in root.children if child.tag.lower() == "import" or child.attributes.get("file"))
    for element in _nodes(root):
        tag = element.tag.lower()
        known = _CHANGES.get(tag, ((), None))[0]
        if tag in _SIGNS or (known and not element.attributes.keys().isdisjoint(known)):
            yield element
