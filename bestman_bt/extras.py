"""Packages that only one feature needs; without them its use raises an error with the command that installs them."""

from __future__ import annotations

from importlib.util import find_spec

PACKAGE_OF_EXTRA = {"objects": "coacd", "rerun": "rerun", "sim": "pybullet"}
"""Extra → the package, by the name that it is imported by, without which nothing of the extra works."""


class MissingExtraError(ImportError):
    """A package that is needed is not installed; the message names the extra that brings it."""


def is_installed(extra: str) -> bool:
    """Return whether the package of an extra is installed, without importing it."""
    return find_spec(PACKAGE_OF_EXTRA[extra]) is not None


def missing_extra(what: str, extra: str) -> MissingExtraError:
    """Return the error that names ``extra`` as what ``what`` needs."""
    package = PACKAGE_OF_EXTRA[extra]
    return MissingExtraError(f"{what} needs the package {package!r}: pip install 'bestman-bt[{extra}]'", name=package)


def require_extra(what: str, extra: str) -> None:
    """Raise MissingExtraError where ``what`` cannot work because the package of ``extra`` is not installed."""
    if not is_installed(extra):
        raise missing_extra(what, extra)
