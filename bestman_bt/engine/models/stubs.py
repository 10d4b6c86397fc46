"""Python skeletons of leaves known from models or from their use."""

from __future__ import annotations

import ast
import builtins
import io
import keyword
import math
import re
import textwrap
import tokenize
from collections.abc import Iterable, Iterator
from typing import Any, Final

from bestman_bt.engine.conversion import ConverterRegistry
from bestman_bt.engine.core.ports import Port, key_of
from bestman_bt.engine.core.registry import NodeInfo
from bestman_bt.engine.errors import ConversionError, TreeLoadError, TreeProblem
from bestman_bt.engine.leaves.base import Condition, StatefulAction

_TYPES: Final[dict[str, Any]] = {
    "int": int,
    "unsigned": int,
    "unsigned int": int,
    "int64_t": int,
    "uint64_t": int,
    "size_t": int,
    "double": float,
    "float": float,
    "bool": bool,
    "std::string": str,
    "string": str,
    "std::vector<int>": list[int],
    "std::vector<double>": list[float],
    "std::vector<bool>": list[bool],
    "std::vector<std::string>": list[str],
}
_KINDS: Final = {"input": "In", "output": "Out", "inout": "InOut"}
_ENGINE_NAMES: Final = ("Condition", "FAILURE", "In", "InOut", "Out", "StatefulAction")
_USED: Final = (*_ENGINE_NAMES, "Any", "annotations")
_HEAD: Final = (
    '"""Leaves of trees: implement them, and load them with --plugin."""\n\nfrom __future__ import annotations\n'
)


def stub_source(infos: Iterable[NodeInfo], existing: bytes, file: str) -> tuple[bytes, list[str]]:
    """Return the content of a Python file with a class for each leaf, and the names of the added classes.

    ``existing``: current content of the file, which is preserved, as are its encoding and line ends; leaves that
    already have a class are not added.

    Raises:
        TreeLoadError: ``existing`` is not valid Python, with the line, or its encoding lacks a needed character.
    """
    try:
        module = ast.parse(existing)
        encoding, _ = tokenize.detect_encoding(io.BytesIO(existing).readline)
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", 0) or 0
        raise TreeLoadError([TreeProblem(file, line, "", "", f"it is not Python: {error.args[0]}")]) from None
    there, imported = _names(module)
    added = [info for info in infos if info.kind in ("Action", "Condition") and info.name not in there]
    if not added:
        return existing, []
    taken = {*there, *imported, *_USED, *dir(builtins)}
    classes = [_class(info, taken) for info in sorted(added, key=lambda info: info.name)]
    body = "\n\n\n".join(classes) + "\n"
    needed = [name for name in _ENGINE_NAMES if re.search(rf"\b{name}\b", body) and name not in imported]
    imports = ["from typing import Any\n"] if re.search(r"\bAny\b", body) and "Any" not in imported else []
    if needed:
        imports.append(f"from bestman_bt.engine import {', '.join(needed)}")
    head = "\n\n\n" if existing.strip() else f"{_HEAD}\n"
    text = "".join([head, "\n".join(imports), "\n\n\n" if imports else "", body])
    if b"\r\n" in existing:
        text = text.replace("\n", "\r\n")
    try:
        content = existing.rstrip() + text.encode(encoding.removesuffix("-sig"))
    except UnicodeEncodeError as error:
        what = f"its encoding {encoding} has no {text[error.start]!r}, which the new classes need; save it as UTF-8"
        raise TreeLoadError([TreeProblem(file, 0, "", "", what)]) from None
    return content, [info.name for info in added]


def _names(module: ast.Module) -> tuple[set[str], set[str]]:
    """Return the node types that a module brings, and the names that it imports."""
    types, classes, imported = set[str](), set[str](), set[str]()
    for statement in _at_module_level(module):
        if isinstance(statement, (ast.Import, ast.ImportFrom)):
            imported |= {alias.asname or alias.name for alias in statement.names}
        elif isinstance(statement, (ast.ClassDef, ast.FunctionDef)):
            types.add(statement.name)
            if isinstance(statement, ast.ClassDef):
                classes.add(statement.name)
            for inner in statement.body:
                targets = inner.targets if isinstance(inner, ast.Assign) else [getattr(inner, "target", None)]
                if isinstance(inner, (ast.Assign, ast.AnnAssign)) and isinstance(inner.value, ast.Constant):
                    types |= {str(inner.value.value) for name in targets if getattr(name, "id", "") == "NAME"}
    for call in ast.walk(module):
        if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "register":
            given: dict[str | None, ast.expr] = dict(zip(("cls", "name"), call.args, strict=False))
            given |= {word.arg: word.value for word in call.keywords}
            cls, name = ast.unparse(given["cls"]) if "cls" in given else "", given.get("name")
            is_class = cls in classes or (cls.partition(".")[0] in imported and cls.rpartition(".")[2][0].isupper())
            if is_class and isinstance(name, ast.Constant):
                types.add(str(name.value))
    return types, imported


def _at_module_level(statement: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements outside classes and functions, also those within ``if`` and ``try``."""
    for inner in ast.iter_child_nodes(statement):
        yield inner
        if not isinstance(inner, (ast.ClassDef, ast.FunctionDef)):
            yield from _at_module_level(inner)


def _class(info: NodeInfo, taken: set[str]) -> str:
    name = _identifier(info.name)
    while name in taken:
        name += "_"
    taken.add(name)
    base = Condition if info.kind == "Condition" else StatefulAction
    words = " ".join(info.description.split()) or f"Stands for the {info.kind.lower()} {info.name}"
    lines = [f"class {name}({base.__name__}):", *_docstring(words)]
    if name != info.name:
        lines += ["", f"    NAME = {info.name!r}"]
    attributes = [_port(port, base) for port in info.ports.values()]
    if attributes:
        lines += ["", *attributes]
    failed = ['        self.feedback_message = "not_implemented"', "        return FAILURE"]
    if base is Condition:
        lines += ["", "    def on_tick(self) -> int:", '        """Answer."""', *failed]
    else:
        lines += ["", "    def on_start(self) -> int:", '        """Begin."""', *failed]
        lines += [
            "",
            "    def on_running(self) -> int:",
            '        """Return the result, or RUNNING."""',
            "        return FAILURE",
        ]
        lines += ["", "    def on_halted(self) -> None:", '        """Stop what was started."""']
    return "\n".join(lines)


def _docstring(words: str) -> list[str]:
    safe = words.replace("\\", "/").replace('"', "'").rstrip(".") + "."
    wrapped = textwrap.wrap(safe, 108) or ["."]
    if len(wrapped) == 1:
        return [f'    """{wrapped[0]}"""']
    return [f'    """{wrapped[0]}', *(f"    {line}" for line in wrapped[1:]), '    """']


def _identifier(name: str) -> str:
    made = re.sub(r"\W+", "_", name).strip("_") or "Leaf"
    made = made if not made[0].isdigit() else f"Leaf_{made}"
    return f"{made}_" if keyword.iskeyword(made) else made


def _port(port: Port, base: type) -> str:
    attribute = re.sub(r"\W+", "_", port.name)
    attribute = f"port_{attribute}" if not attribute or attribute[0].isdigit() or attribute[0] == "_" else attribute
    if keyword.iskeyword(attribute) or hasattr(base, attribute) or attribute in _OF_NODES:
        attribute += "_"
    data_type = _TYPES.get(port.written_type, Any)
    said = port.written_type if data_type is Any and port.written_type not in ("", "BT::AnyTypeAllowed") else ""
    words = " ".join([*port.description.split(), *([f"({said})"] if said else [])])
    arguments = [_type_text(data_type), *([repr(words)] if words else [])]
    default = _default(port, data_type)
    if default is not None:
        arguments.append(f"default={default!r}")
    elif port.direction != "output":
        arguments.append("required=False")
    if attribute != port.name:
        arguments.append(f"port={port.name!r}")
    return f"    {attribute} = {_KINDS[port.direction]}({', '.join(arguments)})"


_OF_NODES: Final = frozenset(
    ("attributes", "children", "line", "log", "name", "parent", "place", "status", "uid", "run")
)


def _type_text(data_type: Any) -> str:
    return (
        data_type.__name__
        if isinstance(data_type, type) and data_type in (int, float, bool, str)
        else ("Any" if data_type is Any else str(data_type))
    )


def _default(port: Port, data_type: Any) -> Any:
    """Return a default as the port takes it, or None if there is none, or none that fits its type."""
    if port.default is None or port.direction == "output":
        return None
    if key_of(port.default, port.name) is not None:
        return port.default
    if data_type in (Any, str):
        return str(port.default) if data_type is str else None
    try:
        converter = ConverterRegistry().converter(data_type)
        made = None if converter is None else converter(str(port.default))
    except ConversionError:
        return None
    numbers = made if isinstance(made, list) else [made]
    finite = all(math.isfinite(number) for number in numbers if isinstance(number, float))
    return made if finite else None  # a port refuses others
