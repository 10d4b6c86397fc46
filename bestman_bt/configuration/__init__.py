"""YAML to checked frozen dataclasses, and where shipped data lies."""

from bestman_bt.configuration.checked import check, override, salvage
from bestman_bt.configuration.data import (
    NO_PYBULLET_DATA,
    beside,
    data_names,
    data_root,
    find_data,
    own_objects,
    own_parts,
    own_pybullet_data,
    pybullet_data,
    user_folders,
)
from bestman_bt.configuration.disturbance import DisturbanceConfig
from bestman_bt.configuration.document import Document, dotted, parse_document, parse_value, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.configuration.run import RunConfig, dump_run, load_run, parse_settings, read_run
from bestman_bt.configuration.task import (
    GoalConfig,
    OpeningConfig,
    TaskConfig,
    TidyConfig,
    TolerancesConfig,
    algorithm_parameters,
    load_task,
    task_of_tree,
)

__all__ = [
    "NO_PYBULLET_DATA",
    "ConfigurationError",
    "DisturbanceConfig",
    "Document",
    "GoalConfig",
    "OpeningConfig",
    "Problem",
    "ProblemCollector",
    "RunConfig",
    "TaskConfig",
    "TidyConfig",
    "TolerancesConfig",
    "algorithm_parameters",
    "beside",
    "check",
    "data_names",
    "data_root",
    "dotted",
    "dump_run",
    "find_data",
    "load_run",
    "load_task",
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
    "salvage",
    "task_of_tree",
    "user_folders",
]
