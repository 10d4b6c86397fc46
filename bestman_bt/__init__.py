"""Behavior-tree task execution for mobile manipulators.

``with bestman_bt.session(robot="diff_panda", scene="kitchen", seed=1) as s: s.run("fetch_cup")``
``bestman_bt.plan("on(cup, counter)", scene="kitchen_furnished").run()``
"""

from __future__ import annotations

import logging
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from bestman_bt.errors import Error

__all__ = ["Error", "plan", "session"]

_HOMES = {"plan": "bestman_bt.runtime.planning", "session": "bestman_bt.runtime"}


def _hiding_files() -> list[str]:
    """The files beside the script that hide a package of ours."""
    beside = Path(sys.path[0] if sys.path else "").resolve()
    names = ("behaviours", "hal") if beside != Path(__file__).parents[1] else ()
    return [str(beside / f"{name}.py") for name in names if (beside / f"{name}.py").is_file()]


def _told(file: str) -> str:
    return f"{file} hides the package '{Path(file).stem}' of bestman-bt, which robots and skills need: rename that file"


for _file in _hiding_files():
    logging.getLogger(__name__).warning(_told(_file))


def refuse_hidden_packages() -> None:
    """Raise ImportError where a file beside the script hides a package of ours."""
    for file in _hiding_files():
        raise ImportError(_told(file), path=file)


def __getattr__(name: str) -> Any:
    """Import what is used when it is used: the engine alone should not load the simulator."""
    if name in _HOMES:
        refuse_hidden_packages()
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'bestman_bt' has no attribute {name!r}")
