"""Behavior-tree task execution for mobile manipulators.

import bestman_bt as bt

bt.load_tree("fetch_cup")
with bt.Session(robot="diff_panda", scene="kitchen", seed=1) as session:
    print(session.run("fetch_cup").outcome)
bt.plan("on(cup, counter)", scene="kitchen_furnished").run()
"""

from __future__ import annotations

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

from bestman_bt.errors import Error
from bestman_bt.extras import hides, hiding_files, refuse_hidden_packages

if TYPE_CHECKING:
    from bestman_bt.api import Session, evaluate, load_tree, nodes
    from bestman_bt.runtime.planning import plan

__all__ = ["Error", "Session", "evaluate", "load_tree", "nodes", "plan"]

_HOMES = {
    "Session": "bestman_bt.api",
    "evaluate": "bestman_bt.api",
    "load_tree": "bestman_bt.api",
    "nodes": "bestman_bt.api",
    "plan": "bestman_bt.runtime.planning",
}


for _file in hiding_files():
    logging.getLogger(__name__).warning(hides(_file))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import each public name on first use, so that the engine alone does not load the simulator."""
    if name in _HOMES:
        refuse_hidden_packages()
        return getattr(import_module(_HOMES[name]), name)
    if name[:1].isupper():
        from bestman_bt.engine.own_files import raise_missing_name

        raise_missing_name(__name__, name)
    renamed = "; use bestman_bt.Session, whose runs are judged" if name == "session" else ""
    raise AttributeError(f"module 'bestman_bt' has no attribute {name!r}{renamed}")
