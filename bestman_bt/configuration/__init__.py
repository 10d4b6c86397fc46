"""YAML to checked frozen dataclasses, and where shipped data lies.

What reads YAML is imported when it is used: who only looks for a file need not load the machinery of the checks.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bestman_bt.configuration.data import (
    beside,
    data_names,
    data_root,
    find_data,
    in_folders,
    no_pybullet_data,
    own_objects,
    own_parts,
    own_pybullet_data,
    pybullet_data,
    shipped_trees,
    user_folders,
)
from bestman_bt.configuration.errors import (
    UNREAD,
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    as_far_as_read,
    told_to_programs,
)

if TYPE_CHECKING:
    from bestman_bt.configuration.checked import check, is_whole, numbered, override, salvage
    from bestman_bt.configuration.disturbance import DisturbanceConfig
    from bestman_bt.configuration.document import Document, dotted, parse_document, parse_value, read_document
    from bestman_bt.configuration.run import (
        RunConfig,
        RunRequest,
        dump_run,
        load_run,
        parse_settings,
        read_run,
        run_of_options,
    )
    from bestman_bt.configuration.task import (
        TaskConfig,
        TolerancesConfig,
        load_task,
        task_of_tree,
    )

_HOMES = {
    "DisturbanceConfig": "disturbance",
    "Document": "document",
    "RunConfig": "run",
    "RunRequest": "run",
    "TaskConfig": "task",
    "TolerancesConfig": "task",
    "check": "checked",
    "dotted": "document",
    "dump_run": "run",
    "is_whole": "checked",
    "load_run": "run",
    "load_task": "task",
    "numbered": "checked",
    "override": "checked",
    "parse_document": "document",
    "parse_settings": "run",
    "parse_value": "document",
    "read_document": "document",
    "read_run": "run",
    "run_of_options": "run",
    "salvage": "checked",
    "task_of_tree": "task",
}

__all__ = [
    "UNREAD",
    "ConfigurationError",
    "DisturbanceConfig",
    "Document",
    "Problem",
    "ProblemCollector",
    "RunConfig",
    "RunRequest",
    "TaskConfig",
    "TolerancesConfig",
    "UnreadError",
    "as_far_as_read",
    "beside",
    "check",
    "data_names",
    "data_root",
    "dotted",
    "dump_run",
    "find_data",
    "in_folders",
    "is_whole",
    "load_run",
    "load_task",
    "no_pybullet_data",
    "numbered",
    "override",
    "own_objects",
    "own_parts",
    "own_pybullet_data",
    "parse_document",
    "parse_settings",
    "parse_value",
    "pybullet_data",
    "read_document",
    "read_run",
    "run_of_options",
    "salvage",
    "shipped_trees",
    "task_of_tree",
    "told_to_programs",
    "user_folders",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
