"""Packages that only one feature needs; without them its use raises an error with the command that installs them."""

from __future__ import annotations

import json
from importlib.util import find_spec
from urllib.parse import urlsplit
from urllib.request import url2pathname

from bestman_bt.errors import MissingExtraError

PACKAGE_OF_EXTRA = {"objects": "coacd", "rerun": "rerun", "sim": "pybullet"}
"""Extra → the package, by the name that it is imported by, without which nothing of the extra works."""


def is_installed(extra: str) -> bool:
    """Return whether the package of an extra is installed, without importing it."""
    return find_spec(PACKAGE_OF_EXTRA[extra]) is not None


def install_command(extra: str) -> str:
    """Return what to type to install an extra, from where this installation came: an index, a file or a checkout."""
    from importlib import metadata  # takes longer than what most commands do

    try:
        origin = json.loads(metadata.distribution("bestman-bt").read_text("direct_url.json") or "{}")
    except metadata.PackageNotFoundError:
        origin = {}
    url, requirement = str(origin.get("url", "")), f"bestman-bt[{extra}]"
    if not url:
        return f"pip install '{requirement}'"
    if origin.get("dir_info", {}).get("editable"):
        return f"pip install -e '{url2pathname(urlsplit(url).path)}[{extra}]'"
    return f"pip install '{requirement} @ {url}'"


def missing_extra(what: str, extra: str) -> MissingExtraError:
    """Return the error that names ``extra`` as what ``what`` needs."""
    package = PACKAGE_OF_EXTRA[extra]
    return MissingExtraError(f"{what} needs the package {package!r}: {install_command(extra)}", name=package)


def require_extra(what: str, extra: str) -> None:
    """Raise MissingExtraError where ``what`` cannot work because the package of ``extra`` is not installed."""
    if not is_installed(extra):
        raise missing_extra(what, extra)
