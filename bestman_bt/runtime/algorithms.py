"""Algorithms as the configuration chooses them: slot → class, with checked parameters."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from bestman_bt.configuration import ConfigurationError, Problem, TaskConfig, algorithm_parameters
from bestman_bt.registry import ALGORITHMS, UnknownNameError


def make_algorithm(task: TaskConfig, slot: str, *needs: Any, **options: Any) -> Any:
    """The algorithm in ``slot``, made as ``Class(*needs, parameters=…, **options)``.

    Its parameters are checked against the dataclass ``<Class>Parameters`` of the class's module.
    Raises ConfigurationError that names the slot, the field and what would be right.
    """
    name, values = task.algorithm(slot)
    try:
        algorithm = ALGORITHMS.resolve(f"{slot}/{name}")
    except UnknownNameError as error:
        raise ConfigurationError([Problem(f"algorithms.{slot}", None, "algorithm", str(error))]) from error
    parameters_type = getattr(import_module(algorithm.__module__), f"{algorithm.__name__}Parameters", None)
    if parameters_type is None:
        if values:
            message = f"{name} takes no parameters, got {', '.join(values)}"
            raise ConfigurationError([Problem(f"algorithms.{slot}", None, "", message)])
        return algorithm(*needs, **options)
    return algorithm(*needs, parameters=algorithm_parameters(slot, values, parameters_type), **options)
