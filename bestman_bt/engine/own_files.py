"""Users' Python files: while one is loaded, it can import the files beside it, like a script.

Modules of different folders are separate: each ``helpers.py`` is visible only to files of its folder.
"""

from __future__ import annotations

import ast
import dis
import importlib
import importlib.util
import inspect
import linecache
import re
import sys
import traceback
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import NoReturn

PACKAGES = ("bestman_bt", "behaviours", "hal")
"""The importable packages of this project."""

_names: dict[Path, set[str]] = {}
"""Folder → the names of its modules and packages."""
_loaded: dict[Path, dict[str, ModuleType]] = {}
"""Folder → the modules imported from it, by name."""
_open: list[Path] = []
"""Folders whose files are being loaded, the innermost last."""


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Make the modules in ``folder`` importable, and hide modules of other such folders and of the script.

    The imported modules are cached for the next file of the folder.
    """
    folder = folder.resolve()
    if _open and _open[-1] == folder:
        yield
        return
    _names[folder] = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()} - {*PACKAGES}
    users = set[str]().union(*_names.values())
    hidden = {
        name: module
        for name, module in sys.modules.items()
        if name.partition(".")[0] in users and _is_elsewhere(name, module, folder)
    }
    for name in hidden:
        del sys.modules[name]
    of_script = {name for name, module in sys.modules.items() if _is_from(name, module, folder)}
    sys.modules.update({name: one for name, one in _loaded.get(folder, {}).items() if name not in of_script})
    if _open:
        sys.path.remove(str(_open[-1]))
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    _open.append(folder)
    try:
        yield
    finally:
        _open.pop()
        sys.path.remove(str(folder))
        if _open:
            sys.path.insert(0, str(_open[-1]))
        _loaded[folder] = {name: module for name, module in sys.modules.items() if _is_from(name, module, folder)}
        for name in _loaded[folder].keys() - of_script:
            del sys.modules[name]
        sys.modules.update(hidden)


def load_file(path: Path, name: str) -> ModuleType:
    """Execute a Python file as the module ``name``, which stays in ``sys.modules``; its exceptions propagate.

    Raises:
        ImportError: it is not a Python file.
    """
    specification = importlib.util.spec_from_file_location(name, path)
    if specification is None or specification.loader is None:
        raise ImportError("it should be a Python file (.py)")
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    try:
        with importable(path.parent):
            specification.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name, None)
        raise
    return module


def plugin_module(path: Path) -> str:
    """Return the module name for a user's file; files of the same name in different folders get different names."""
    return f"bestman_bt_plugin_{path.stem}_{zlib.crc32(bytes(path.resolve())):08x}"


@contextmanager
def module_of(cls: type) -> Iterator[ModuleType]:
    """Yield the module of a class; modules beside it are importable meanwhile if it is a user's."""
    for folder, modules in _loaded.items():
        module = modules.get(cls.__module__)
        if module is not None and getattr(module, cls.__name__, None) is cls:
            with importable(folder):
                yield module
            return
    yield importlib.import_module(cls.__module__)


def described(error: BaseException, path: Path) -> tuple[str, int, str]:
    """Return file, line (0: unknown) and message of an error raised while ``path`` was loaded.

    The line is the innermost one in the file, or in a file of its folder.
    """
    words = f"{type(error).__name__}: {error}"
    if isinstance(error, ImportError):
        top = (error.name or "").partition(".")[0]
        if top in PACKAGES and (path.parent / f"{top}.py").is_file():
            words += f"; {path.parent / top}.py has the name of a package of bestman-bt: rename it"
        elif hints := _right_places(error):
            words += f"; {' and '.join(hints)}"
    folder = path.resolve().parent
    places = [(frame.filename, frame.lineno or 0) for frame in _frames(error)]
    if isinstance(error, SyntaxError) and error.filename:
        places.append((error.filename, error.lineno or 0))
        words = f"{type(error).__name__}: {error.msg}"
    for file, line in reversed(places):
        found = Path(file).resolve()
        if found.is_relative_to(folder) and not {"site-packages", *PACKAGES} & {*found.relative_to(folder).parts}:
            return str(path.parent / found.relative_to(folder)), line, words
    return str(path), 0, words


def _right_places(error: ImportError) -> list[str]:
    """Return the modules of this project that define a name that could not be imported."""
    wanted, frames = error.name or "", _frames(error)
    if wanted.partition(".")[0] not in PACKAGES or not frames:
        return []
    imports = ast.walk(ast.parse("".join(linecache.getlines(frames[-1].filename))))
    froms = [one for one in imports if isinstance(one, ast.ImportFrom) and one.module == wanted]
    names = [alias.name for one in froms for alias in one.names]
    has: dict[str, list[str]] = {}
    for name in names if wanted != "behaviours" else ():
        for module in modules_exporting(name):
            if module != wanted:
                has.setdefault(module, []).append(name)
    if has:
        return [f"{module} has {', '.join(held)}" for module, held in has.items()]
    called = names if wanted == "behaviours" else [wanted.rpartition(".")[2]]
    modules = [module for module in _modules() if module.startswith("behaviours.") and module != wanted]
    return [f"there is {module}" for module in modules if module.rpartition(".")[2] in called]


@lru_cache
def modules_exporting(name: str) -> list[str]:
    """Return the modules of this project that export a class, function or constant, skills first."""
    defined = re.compile(rf"^(?:class |def |){name}\b", re.MULTILINE)
    found = []
    for module, path in _modules().items():
        if not name.isidentifier() or name.startswith("_") or not defined.search(path.read_text(encoding="utf-8")):
            continue
        folder = path.parent
        while (face := folder / "__init__.py").is_file() and f'"{name}"' in face.read_text(encoding="utf-8"):
            module, folder = module.rpartition(".")[0], folder.parent
        found.append(module)
    return list(dict.fromkeys(found))


def raise_missing_name(module: str, name: str, renamed: Mapping[str, str] = MappingProxyType({})) -> NoReturn:
    """Raise AttributeError naming the module that has ``name``; ImportError for a ``from`` import of a class.

    A ``from`` import would discard the message of an AttributeError. ``renamed``: old → new names in ``module``.
    """
    asking = sys._getframe(2)
    homes = [home for home in (modules_exporting(name) if name[:1].isupper() else ()) if home != module]
    place = f": from {module} import {renamed[name]}" if name in renamed else ""
    place = place or (f": from {homes[0]} import {name}" if homes else "")
    if place and dis.opname[asking.f_code.co_code[asking.f_lasti]] == "IMPORT_FROM":
        raise ImportError(f"{module} has no {name!r}{place}", name=module)
    raise AttributeError(f"module {module!r} has no attribute {name!r}{place}")


def _modules() -> dict[str, Path]:
    """Return the modules of bestman-bt by name, those of skills first."""
    root = Path(__file__).parents[2]
    paths = [path for package in ("behaviours", "bestman_bt") for path in sorted((root / package).rglob("*.py"))]
    return {".".join(path.relative_to(root).with_suffix("").parts): path for path in paths if path.stem != "__init__"}


def _frames(error: BaseException) -> list[traceback.FrameSummary]:
    """Return the frames whose code is in a file; methods generated for dataclasses have none (``<string>``)."""
    return [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith("<")]


def user_line(error: BaseException) -> str:
    """Return ``file:line``, the innermost line of a user's file in an error's traceback, or an empty text."""
    for frame in reversed(_frames(error)):
        if Path(frame.filename).resolve().parent in _names:
            return f"{frame.filename}:{frame.lineno}"
    return ""


def defined_at(function: Callable[..., object]) -> str:
    """Return ``file:line`` of a function or method."""
    code = inspect.unwrap(getattr(function, "__func__", function)).__code__
    return f"{code.co_filename}:{code.co_firstlineno}"


def signature_fault(cls: type, base: type) -> str:
    """Return the method of ``cls`` that cannot be called like its interface ``base``, with file and line; empty if
    none.
    """
    return _signature_fault(cls, base)


@cache
def _signature_fault(cls: type, base: type) -> str:
    for name in dir(base):
        wanted, own = inspect.getattr_static(base, name), inspect.getattr_static(cls, name)
        if name.startswith("_") or own is wanted or not (inspect.isfunction(wanted) and inspect.isfunction(own)):
            continue
        asked = inspect.signature(wanted).parameters.values()
        given = {one.name: one for one in asked if one.kind is one.KEYWORD_ONLY}
        try:
            inspect.signature(own).bind(*(one for one in asked if one.kind is one.POSITIONAL_OR_KEYWORD), **given)
        except TypeError:
            words = f"{cls.__name__}.{name} should take {_arguments(wanted)}, but takes {_arguments(own)}"
            return f"{words} (at {defined_at(own)})"
    return ""


def _arguments(function: Callable[..., object]) -> str:
    parameters = inspect.signature(function).parameters.values()
    return f"({', '.join(str(one.replace(annotation=one.empty)) for one in parameters)})"


def describe_error(error: BaseException) -> str:
    """Return type and message of an error, and its line in a user's file, if any."""
    place = user_line(error)
    text = str(error)
    kind = type(error).__name__
    return (f"{kind}: {text}" if text else kind) + (f" (at {place})" if place else "")


def _is_from(name: str, module: ModuleType, folder: Path) -> bool:
    """Return whether a module is one of those in a folder of a user."""
    top = name.partition(".")[0]
    if top not in _names[folder]:
        return False
    found = Path(_file_of(module)).resolve()
    return found.is_relative_to(folder) and found.relative_to(folder).parts[:1] in ((top,), (f"{top}.py",))


def _is_elsewhere(name: str, module: ModuleType, folder: Path) -> bool:
    """Return whether a module comes from another folder of a user, or hides one of this folder, as a script's own
    does.
    """
    if any(_is_from(name, module, other) for other in _names if other != folder):
        return True
    top = name.partition(".")[0]
    if top not in _names[folder] or top in sys.stdlib_module_names or name == "__main__":
        return False
    file = _file_of(module)
    return bool(file) and "site-packages" not in file and not _is_from(name, module, folder)


def _file_of(module: ModuleType) -> str:
    """Return the file of a module, or the folder of a package without one; empty where it has none."""
    return getattr(module, "__file__", None) or next(iter(getattr(module, "__path__", ())), "")
