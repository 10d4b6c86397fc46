"""Common parts of several verbs: options, checks of their values, the confirmation that ``--yes`` replaces,
``--json``.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import inspect
import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.extras import EXTRA_OF_SIMULATOR

if TYPE_CHECKING:
    from bestman_bt.configuration.run import RunRequest
    from bestman_bt.engine import NodeRegistry
    from bestman_bt.engine.models.package import Package
    from bestman_bt.evaluation.launchers.launcher import Launcher
    from bestman_bt.messages import Pose


def grouped_options(command: Callable[..., None]) -> Callable[..., None]:
    """Expand each parameter of ``command`` that is a dataclass to one option per field, for typer."""
    options: list[inspect.Parameter] = []
    groups: dict[str, tuple[Callable[..., Any], list[str]]] = {}
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        group = parameter.annotation
        if isinstance(group, type) and dataclasses.is_dataclass(group):
            fields = inspect.signature(group, eval_str=True).parameters
            groups[parameter.name] = (group, list(fields))
            options += fields.values()
        else:
            options.append(parameter)

    @functools.wraps(command)
    def with_groups(**values: Any) -> None:
        grouped = {name: group(**{key: values.pop(key) for key in keys}) for name, (group, keys) in groups.items()}
        command(**values, **grouped)

    parameters = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]
    with_groups.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # typer reads it
    with_groups.__annotations__ = {option.name: option.annotation for option in options}
    return with_groups


def writable_file(path: Path | None) -> Path | None:
    """Check that a result file can be written, before the work starts. Raises typer.BadParameter."""
    if path is None:
        return None
    if path.is_dir() or not path.parent.is_dir():
        raise typer.BadParameter(
            f"'{path}' is a folder" if path.is_dir() else f"the folder '{path.parent}' does not exist"
        )
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise typer.BadParameter(f"'{path}' may not be written")
    return path


def refuse_unwritable_folder(path: Path, option: str) -> None:
    """Raise typer.BadParameter if the folder, which may not exist yet, cannot be written to."""
    there = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    if not there.is_dir():
        raise typer.BadParameter(f"'{there}' is not a folder", param_hint=option)
    if not os.access(there, os.W_OK):
        raise typer.BadParameter(f"'{there}' may not be written", param_hint=option)


def _writable_png(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".png":
        raise typer.BadParameter(f"pictures are PNG files: FILE.png, got '{path}'")
    return writable_file(path)


def _simulator(name: str) -> str:
    if name not in EXTRA_OF_SIMULATOR:
        raise typer.BadParameter(f"{name!r} does not simulate: {' or '.join(sorted(EXTRA_OF_SIMULATOR))}")
    return name


Seed = Annotated[int, typer.Option(min=0, max=2**62 - 1, help="Seed of the scene, the noise and all samples.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a setting: scene.…, robot.… or a field of the task."),
]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="Load skills, algorithms, planners and parts of yours."),
]
Models = Annotated[
    list[Path] | None,
    typer.Option("--models", metavar="PATH", help="Files, folders or .btproj whose TreeNodesModels describe nodes."),
]
Search = Annotated[
    list[Path] | None,
    typer.Option("--search", metavar="DIR", help="Folders, or .btproj, that have the SubTrees of others, by ID."),
]
Json = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON document on standard output; other output goes to standard error."),
]
Driver = Annotated[
    str,
    typer.Option(
        help="Which robot: pybullet or mujoco, simulated; hardware for the controllers in the robot's YAML; or replay."
    ),
]
Engine = Annotated[str, typer.Option(help="What simulates: pybullet or mujoco.", callback=_simulator)]
Scene = Annotated[str | None, typer.Option(help="A shipped scene or a YAML file.")]
Png = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Write a picture.", callback=_writable_png, show_default=False)
]
Robot = Annotated[str | None, typer.Option(help="A shipped robot or a YAML file.")]
SavedWorld = Annotated[
    Path | None,
    typer.Option("--world", metavar="FILE", help="The initial beliefs: world.yaml of a run folder."),
]
Groot2Port = Annotated[
    int | None,
    typer.Option(min=1, max=65534, help="Let Groot2 connect there and to the next port; its own default is 1667."),
]
Live = Annotated[bool, typer.Option("--live", help="Show it live in the Rerun viewer.")]
Monitor = Annotated[
    bool,
    typer.Option(
        "--monitor", help="Show the run live in the browser; prints the address. The page stays after the run."
    ),
]
MonitorPort = Annotated[int, typer.Option(min=1, max=65535, help="With --monitor: the port of the page.")]
MONITOR_PORT = 8750


@dataclass(frozen=True)
class PlanningOptions:
    """The planning problem and the known world; ``world`` is read together with the request."""

    task: Annotated[
        str | None, typer.Option(help="The task that gives the scene, the robot and, by default, the goal.")
    ] = None
    scene: Scene = None
    robot: Robot = None
    seed: Seed = 0
    world: SavedWorld = None
    settings: Settings = None
    plugins: Plugins = None

    @property
    def request(self) -> RunRequest:
        """Return the options as a run request."""
        from bestman_bt.configuration.run import RunRequest

        return RunRequest(self.task, None, self.scene, self.robot, self.seed, self.settings, self.plugins)


@dataclass(frozen=True)
class MonitorOptions:
    """Whether and where the page of the live monitor is shown."""

    monitor: Monitor = False
    monitor_port: MonitorPort = MONITOR_PORT


@dataclass(frozen=True)
class OtherFiles:
    """Further files that define SubTrees, node models and nodes for a tree."""

    models: Models = None
    search: Search = None
    plugins: Plugins = None

    @property
    def paths(self) -> list[Path]:
        """Return the files and folders with further models and SubTrees, for ``Package.open``."""
        return [*(self.models or ()), *(self.search or ())]

    def package(self, tree: str | None = None) -> Package:
        """Return the further files, with those of the package ``tree``, if given.

        Raises TreeLoadError if a further file cannot be read, or their models contradict each other.
        """
        from bestman_bt.configuration.data import shipped_trees
        from bestman_bt.engine.models.package import Package

        further = Package.open(self.paths, shipped_trees())
        further.refuse_broken()
        return further if tree is None else Package.open([tree, *self.paths], shipped_trees())

    def registry(self) -> NodeRegistry:
        """Return the shipped nodes and those of the plug-ins. Raises ConfigurationError if one cannot be loaded."""
        from bestman_bt.runtime.plugins import node_registry

        return node_registry([str(plugin) for plugin in self.plugins or ()])


def is_package(path: str) -> bool:
    """Return whether an argument names a folder of trees, or a project of Groot2."""
    return Path(path).suffix == ".btproj" or Path(path).is_dir()


@dataclass(frozen=True)
class LauncherOptions:
    """The number of processes, and the machines."""

    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, help="Episodes at the same time; 1, or all that the cluster has room for.", show_default=False
        ),
    ] = None
    launcher: Annotated[str, typer.Option(help="What runs the episodes: local, slurm, ray, or one of yours.")] = "local"
    slurm: Annotated[bool, typer.Option("--slurm", help="Short for --launcher slurm.")] = False
    address: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Of the launcher's cluster.", show_default=False)
    ] = None

    @property
    def name(self) -> str:
        """The name of the launcher."""
        return "slurm" if self.slurm else self.launcher

    def made(self, folder: Path, monitor: bool = False) -> Launcher:
        """Return the launcher of episodes kept in ``folder``. Raises ConfigurationError, UnknownNameError."""
        from bestman_bt.evaluation.launchers.launcher import LaunchOptions
        from bestman_bt.registry import LAUNCHERS

        launcher: Launcher = LAUNCHERS.resolve(self.name)(LaunchOptions(self.jobs, self.address or "", folder, monitor))
        return launcher

    def problems(self) -> list[Problem]:
        """Return what contradicts itself."""
        if self.slurm and self.launcher not in ("local", "slurm"):
            return [Problem("--slurm", None, "", f"contradicts --launcher {self.launcher}")]
        if self.address and self.name == "local":
            return [Problem("--address", None, "", "applies only to a cluster; also give its --launcher")]
        return []


def wrong_input(source: str, message: str) -> ConfigurationError:
    """Return the error for an option, or a file, that is wrong."""
    return ConfigurationError([Problem(source, None, "", message)])


def number(option: str, text: str, *dimensions: str, allow_zero: bool = False) -> float:
    """Return a quantity above 0 in SI units, for example 0.005 for ``5mm`` with the dimension ``length``. Raises
    ConfigurationError.
    """
    from bestman_bt.configuration.quantity import parse_quantity

    try:
        value = parse_quantity(text, *dimensions)
    except ValueError as error:
        raise wrong_input(option, str(error)) from error
    if value < 0.0 or (value == 0.0 and not allow_zero):
        raise wrong_input(option, f"should be {'0 or more' if allow_zero else 'more than 0'}, got {text}")
    return value


def pose(option: str, text: str) -> Pose:
    """Return the pose of ``x y z roll pitch yaw``, metres and radians. Raises ConfigurationError."""
    from bestman_bt.messages import Pose

    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != 6 or not all(map(math.isfinite, values)):
        raise wrong_input(
            option, f"should be six finite numbers, x y z in metres, roll pitch yaw in radians, got {text!r}"
        )
    return Pose.from_xyz_rpy(values[:3], values[3:])


def confirmed(question: str) -> bool:
    """Ask ``question`` in the terminal and return whether the user agrees. Raises ConfigurationError without a
    terminal."""
    if not sys.stdin.isatty():
        raise wrong_input("--yes", "is required without a terminal, where no confirmation is possible")
    return typer.confirm(question, err=True)


@contextmanager
def json_output(wanted: bool) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Yield a function that receives the document. If ``wanted``, the document is printed at the end, and other output
    goes to standard error.

    The redirection includes C libraries: it replaces the file descriptor.
    """
    documents: list[dict[str, Any]] = []
    if not wanted:
        yield documents.append
        return
    try:
        with redirect_stdout(sys.stderr), _descriptor_to_standard_error():
            yield documents.append
    finally:  # also where the verb ends with an exit code
        for document in documents:
            print(json.dumps(document, allow_nan=False), flush=True)


@contextmanager
def _descriptor_to_standard_error() -> Iterator[None]:
    c_library = ctypes.CDLL(None)
    c_library.fflush(None)
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        c_library.fflush(None)
        os.dup2(kept, 1)
        os.close(kept)
