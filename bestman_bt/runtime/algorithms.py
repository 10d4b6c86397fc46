"""Resolution of the configured algorithms: slot → class, with checked parameters."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from behaviours.nav2.ports import AlgorithmName
from bestman_bt.configuration.checked import field_paths, salvage
from bestman_bt.configuration.data import in_folders
from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.configuration.run import RunConfig
from bestman_bt.engine import Tree
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.own_files import described, importable, load_file, module_of, plugin_module, signature_fault
from bestman_bt.engine.unwritten import problem_at
from bestman_bt.errors import MissingExtraError
from bestman_bt.manipulation.base_placement import BasePlacementPlanner, PathPlacementPlanner
from bestman_bt.manipulation.collision.base import CollisionModel
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.motion_planning.base import MotionPlanner
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.trajectory.base import TimeParametrization
from bestman_bt.messages.shapes import check_bounds
from bestman_bt.navigation.global_planning.base import GlobalPlanner
from bestman_bt.navigation.global_planning.costmap import CostmapBuilder
from bestman_bt.navigation.local_planning.base import PathFollower
from bestman_bt.navigation.localization.base import GlobalLocalizer, Localizer
from bestman_bt.navigation.localization.ekf import OdometryFilter
from bestman_bt.navigation.slam.base import Slam
from bestman_bt.navigation.slam.frontiers import ExplorationPlanner
from bestman_bt.perception.affordance.front_handles import HandleDetector
from bestman_bt.perception.detection.base import Detector
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspPlanner
from bestman_bt.perception.occupancy import OccupancyMapper
from bestman_bt.perception.pose_estimation.base import PoseEstimator
from bestman_bt.perception.pose_estimation.multi_view import MultiViewEstimator
from bestman_bt.perception.segmentation.base import Segmentation
from bestman_bt.perception.segmentation.support_surfaces import SurfaceDetector
from bestman_bt.perception.tracking import Tracker
from bestman_bt.perception.view_planning import ViewPlanner
from bestman_bt.registry import ALGORITHMS, PLUGIN_EXAMPLES, UnknownNameError, class_and_preset, suggestion
from bestman_bt.robot_model.model import ArmModel, BaseModel, RobotModel, WheeledBaseModel
from bestman_bt.robot_model.sensor_parts import ImuPart
from bestman_bt.runtime.own_results import with_checked_results
from bestman_bt.runtime.tree_checks import literals
from bestman_bt.world_model.semantic_map import SemanticMap


@dataclass(frozen=True)
class AlgorithmSlot:
    """A slot of ``algorithms:``, for subclasses of ``base`` registered as ``kind/NAME``.

    ``given``: fields of the algorithm that the session fills: the robot, the map, other algorithms. All other fields
    are parameters.
    """

    base: type[Any]
    kind: str
    given: tuple[str, ...] = ()


SLOTS: dict[str, AlgorithmSlot] = {
    "segmentation": AlgorithmSlot(Segmentation, "segmentation"),
    "surfaces": AlgorithmSlot(SurfaceDetector, "segmentation"),
    "pose_estimation": AlgorithmSlot(PoseEstimator, "pose_estimation"),
    "multi_view": AlgorithmSlot(MultiViewEstimator, "pose_estimation"),
    "detection": AlgorithmSlot(Detector, "detection", ("segmentation", "pose_estimator")),
    "tracking": AlgorithmSlot(Tracker, "tracking"),
    "view_planning": AlgorithmSlot(ViewPlanner, "view_planning"),
    "affordance": AlgorithmSlot(HandleDetector, "affordance"),
    "occupancy": AlgorithmSlot(OccupancyMapper, "occupancy"),
    "grasp_pose": AlgorithmSlot(GraspPlanner, "grasp_pose"),
    "unknown_grasp_pose": AlgorithmSlot(GraspPlanner, "grasp_pose"),
    "handle_grasp_pose": AlgorithmSlot(GraspPlanner, "grasp_pose"),
    "kinematics": AlgorithmSlot(InverseKinematics, "kinematics", ("robot", "arm", "fixed")),
    "collision": AlgorithmSlot(CollisionModel, "collision", ("robot",)),
    "motion_planning": AlgorithmSlot(MotionPlanner, "motion_planning"),
    "trajectory": AlgorithmSlot(TimeParametrization, "trajectory"),
    "base_placement": AlgorithmSlot(BasePlacementPlanner, "base_placement"),
    "path_placement": AlgorithmSlot(PathPlacementPlanner, "base_placement"),
    "costmap": AlgorithmSlot(CostmapBuilder, "global_planning"),
    "global_planning": AlgorithmSlot(GlobalPlanner, "global_planning"),
    "local_planning": AlgorithmSlot(PathFollower, "local_planning"),
    "localization": AlgorithmSlot(Localizer, "localization", ("planar_map",)),
    "slam": AlgorithmSlot(Slam, "slam"),
    "exploration": AlgorithmSlot(ExplorationPlanner, "slam"),
    "global_localization": AlgorithmSlot(GlobalLocalizer, "localization"),
    "odometry": AlgorithmSlot(OdometryFilter, "localization"),
}


_OF_ARMS = ("kinematics", "collision")
_ClassAndPreset = tuple[type[Any], dict[str, Any]]


class Algorithms:
    """The configured algorithms, one attribute per slot, such as ``detection``; each is created on first use.

    ``semantic_map``: the map for localisation; only a localizer needs it. A user's own algorithms are created
    immediately, to check that this is possible. Raises ConfigurationError listing the faults of all slots.
    """

    def __init__(self, config: RunConfig, model: RobotModel, semantic_map: SemanticMap | None = None) -> None:
        self._config, self._model, self._map = config, model, semantic_map
        self._of_arms: dict[tuple[str, str], Any] = {}
        faults, own = ProblemCollector(), []
        for slot in SLOTS:
            with faults.step():
                algorithm, _ = _choose(config, slot)
                if not algorithm.__module__.startswith("bestman_bt."):
                    own.append(slot)
        for slot in own:
            with faults.step():
                if semantic_map if slot == "localization" else model.of(ArmModel) or slot not in _OF_ARMS:
                    self.of_arm(slot, "")
        faults.raise_if_any()

    def __getattr__(self, slot: str) -> Any:
        if slot not in SLOTS:
            raise AttributeError(f"there is no slot {slot!r}; known: {', '.join(SLOTS)}")
        return self.of_arm(slot, "")

    def of_arm(self, slot: str, arm: str) -> Any:
        """Return the algorithm in a slot; ``arm``: the arm of its kinematics, by default the default arm.

        Only kinematics depends on the arm.
        """
        key = (slot, (arm or self._model.arm_named()) if slot == "kinematics" else "")
        if key not in self._of_arms:
            self._of_arms[key] = self._made(*key)
        return self._of_arms[key]

    def _made(self, slot: str, arm: str) -> Any:
        make, model = partial(make_algorithm, self._config), self._model
        match slot:
            case "detection":
                return make(slot, segmentation=make("segmentation"), pose_estimator=make("pose_estimation"))
            case "kinematics":
                return make(slot, model, arm=arm)
            case "collision":
                return make(slot, model)
            case "motion_planning":
                return TimedMotionPlanner(make(slot), make("trajectory"))
            case "localization":
                localizer: Localizer = make(slot, self._map)
                if any(base.part.turning_slip != 1.0 for base in model.of(WheeledBaseModel).values()):
                    return localizer.for_dragged_wheels()
                return localizer
        return make(slot)


def check_odometry(config: RunConfig, model: RobotModel) -> None:
    """Raise ConfigurationError if the odometry filter needs a gyroscope that the robot lacks."""
    if model.of(BaseModel) and not model.of(ImuPart) and make_algorithm(config, "odometry").uses_gyro:
        message = f"needs a robot with an inertial measurement unit, and {config.task.robot} has none"
        raise ConfigurationError([config.problem(("algorithms", "odometry", "algorithm"), message)])


def prepare_detection(config: RunConfig) -> None:
    """Let the detector load its files.

    Raises ConfigurationError if that fails. Invalid parameters of its parts are ignored here.
    """
    make = partial(make_algorithm, config, faults=[])
    detector: Detector = make("detection", segmentation=make("segmentation"), pose_estimator=make("pose_estimation"))
    try:
        detector.prepare()
    except (PerceptionError, MissingExtraError) as error:
        raise ConfigurationError([config.problem(("algorithms", "detection"), str(error))]) from error


def algorithm_by_name(config: RunConfig, slot: str, name: str, folders: tuple[Path, ...] = ()) -> Any:
    """Return the algorithm that a tree names: with its configured parameters if it is the configured one, else
    defaults.

    A name of Nav2 is mapped by the task; None means the configured algorithm. ``folders``: searched first for
    ``file.py:Class`` and ``module:Class``. Raises UnknownNameError.
    """
    name = config.task.nav2.of(slot).get(name, name)
    if not name:
        return None
    try:
        return make_algorithm(config, slot, name=name, folders=folders)
    except ConfigurationError as error:
        raise UnknownNameError(message_for_tree(error)) from error


def nav2_problems(config: RunConfig) -> Iterator[Problem]:
    """Yield a problem for each Nav2 name that the task maps to an unknown algorithm."""
    for slot, kind in (("global_planning", "planners"), ("local_planning", "controllers")):
        for name, ours in config.task.nav2.of(slot).items():
            try:
                algorithm, _ = _choose(config, slot, ours)
            except ConfigurationError as error:
                if ours:
                    yield config.problem(("nav2", kind, name), error.problems[0].message)
                continue
            if ours:
                known = f"{SLOTS[slot].kind}/{ours.removeprefix(f'{SLOTS[slot].kind}/')}"
                ALGORITHMS.add(f"{slot}/{name}", ALGORITHMS.resolve(known) if known in ALGORITHMS else algorithm)


def message_for_tree(error: ConfigurationError) -> str:
    """Return the message for a tree that names a class which cannot be created, with file and line."""
    problem = error.problems[0]
    where = f"{problem.source}:{problem.line}: " if problem.line and problem.source.endswith(".py") else ""
    return where + problem.message


def algorithm_problems(tree: Tree, config: RunConfig) -> Iterator[TreeProblem]:
    """Yield the user's algorithms (``file.py:Class``, ``module:Class``) that a tree names but that cannot be created.

    Each problem gives the line in the tree.
    """
    reported: set[tuple[int, str]] = set()
    for node in tree.nodes:
        for port, information in tree.info_of(node).ports.items():
            slot = next((bound.slot for bound in information.bounds or () if isinstance(bound, AlgorithmName)), "")
            if not slot or port not in node.attributes:
                continue
            for place, where, name in literals(node, port, tree):
                if ":" not in name or (place.uid, where) in reported:
                    continue
                try:
                    algorithm_by_name(config, slot, name, node.folders)
                except UnknownNameError as error:
                    reported.add((place.uid, where))
                    yield problem_at(place, where, str(error), "")


def make_algorithm(
    config: RunConfig,
    slot: str,
    *needs: Any,
    name: str = "",
    folders: tuple[Path, ...] = (),
    faults: list[Problem] | None = None,
    **parts: Any,
) -> Any:
    """Return the algorithm in ``slot``, created as ``Class(*needs, **parameters, **parts)``.

    ``name``: replaces the configured one; its parameters are then the defaults. ``folders``: searched first for files
    and modules. ``parts``: other algorithms that it uses. With ``faults``, invalid parameters are added there and
    omitted. Raises ConfigurationError naming the slot, the field and what is accepted.
    """
    algorithm, parameters = _choose(config, slot, name, folders, faults)
    if algorithm.__module__.startswith("bestman_bt."):
        return algorithm(*needs, **parameters, **parts)
    return made_of_own(algorithm, SLOTS[slot].base, f"algorithms.{slot}", *needs, **parameters, **parts)


def parameters_of(algorithm: type[Any], slot: str, preset: Mapping[str, Any]) -> type[Any] | None:
    """Return a dataclass of the parameters of an algorithm in ``slot``, or None if it has none.

    They are the fields of the algorithm's dataclass without those that the session fills, and without those that the
    class requires and the ``preset`` sets: these distinguish the presets of a class.
    """
    if not dataclasses.is_dataclass(algorithm):
        return None
    kind: Any = algorithm  # mypy takes the types of dataclasses for unhashable
    given = SLOTS[slot].given if slot else ()
    return _parameters_of(kind, (*given, *_fixed(kind, given, preset)))


def _fixed(algorithm: Any, given: Collection[str], preset: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that the class requires and the preset sets, without those that the session has ``given``."""
    if not dataclasses.is_dataclass(algorithm):
        return {}
    required = [field.name for field in dataclasses.fields(algorithm) if _default_of(field) is dataclasses.MISSING]
    return {name: preset[name] for name in required if name in preset and name not in given}


def _default_of(field: dataclasses.Field[Any]) -> Any:
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


@cache
def _parameters_of(algorithm: Any, given: tuple[str, ...]) -> type[Any] | None:
    own = [field for field in dataclasses.fields(algorithm) if field.init and field.name not in given]
    if not own:
        return None
    hints: dict[str, Any] = {}
    classes: list[Any] = [base for base in reversed(algorithm.__mro__) if dataclasses.is_dataclass(base)]
    for one in classes:
        with module_of(one):
            hints |= inspect.get_annotations(one, eval_str=True)
    return dataclasses.make_dataclass(
        algorithm.__name__,
        [(each.name, hints[each.name], _default(each)) for each in own],
        namespace={"__post_init__": check_bounds},
        frozen=True,
        kw_only=True,
    )


def _default(field: dataclasses.Field[Any]) -> Any:
    return dataclasses.field(default=field.default, default_factory=field.default_factory)


def _choose(
    config: RunConfig,
    slot: str,
    name: str = "",
    folders: tuple[Path, ...] = (),
    faults: list[Problem] | None = None,
) -> tuple[type[Any], dict[str, Any]]:
    """Return the class in a slot and the parameters that are set for it; raises the errors of ``make_algorithm``."""
    configured, values = config.task.algorithm(slot)
    if name and name != configured:
        values = {}
    name = name or configured
    algorithms = _in_slot(slot)
    name = name.removeprefix(f"{SLOTS[slot].kind}/")
    if ":" in name:
        algorithms = {name: (class_at(name, folders, partial(config.problem, ("algorithms", slot, "algorithm"))), {})}
    if name not in algorithms:
        raise ConfigurationError(list(_faults_of_unknown(config, slot, name, values, algorithms)))
    algorithm, preset = algorithms[name]
    refuse_unfinished(algorithm, SLOTS[slot].base, f"algorithms.{slot}")
    with module_of(algorithm) as module:
        beside = getattr(module, f"{algorithm.__name__}Parameters", None)
        if beside is not None:
            source, line = inspect.getsourcefile(beside), inspect.getsourcelines(beside)[1]
            message = f"the fields of {beside.__name__} should match the dataclass fields of {algorithm.__name__}"
            raise ConfigurationError([Problem(str(source), line, f"algorithms.{slot}", message)])
        fixed = _fixed(algorithm, SLOTS[slot].given, preset)
        parameters_type = parameters_of(algorithm, slot, preset)
        if parameters_type is None:
            if values:
                message = f"{name} takes no parameters, got {', '.join(values)}"
                raise ConfigurationError([config.problem(("algorithms", slot), message)])
            return algorithm, fixed
        known = {field.name: _default_of(field) for field in dataclasses.fields(parameters_type)}
        below = {field: value for field, value in preset.items() if field in known}
        given = below | _completed({k: v for k, v in values.items() if k not in fixed}, known | below)
        origins = dict.fromkeys(field_paths(values), (f"algorithms.{slot}", None))
        checked, problems = salvage(Document(given, origins), parameters_type)
    for field in fixed.keys() & values.keys():
        message = f"the algorithm {name!r} fixes it to {fixed[field]!r}; set algorithms.{slot}.algorithm instead"
        problems.append(Problem("", None, field, message))
    if problems and faults is None:
        raise ConfigurationError([_placed(config, slot, problem) for problem in problems])
    return algorithm, fixed | {field: getattr(checked, field) for field in given if field in known}


def _completed(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``values``; a group among them has the other fields of the default group, not those of its class."""
    completed = dict(values)
    for name, value in values.items():
        if isinstance(value, Mapping) and dataclasses.is_dataclass(defaults.get(name)):
            _, fields = class_and_preset(defaults[name])
            completed[name] = fields | _completed(value, fields)
    return completed


def _faults_of_unknown(
    config: RunConfig, slot: str, name: str, values: Iterable[str], algorithms: Mapping[str, _ClassAndPreset]
) -> Iterator[Problem]:
    """Yield the fault of a name that no algorithm of a slot has, then those of parameters that none of them has."""
    message = f"unknown algorithm {name!r}; {suggestion(name, list(algorithms))}"
    if "known: " not in message:
        message += f" (known: {', '.join(sorted(algorithms))})"
    if example := PLUGIN_EXAMPLES.get(f"{SLOTS[slot].kind}/{name}"):
        message = f"{name!r} is a plug-in now: name it as {example!r}, a file of bestman-bt's sources"
    yield config.problem(("algorithms", slot, "algorithm"), message)
    types = [parameters_of(algorithm, slot, preset) for algorithm, preset in algorithms.values()]
    known = {field.name for one in types if one is not None for field in dataclasses.fields(one)}
    for field in values:
        if field not in known:
            message = f"no algorithm of this slot has it; {suggestion(field, sorted(known))}"
            yield config.problem(("algorithms", slot, field), message)


def algorithms_by_slot() -> dict[str, dict[str, _ClassAndPreset]]:
    """Return slot → its registered algorithms, by name: the class and the fields that the name sets."""
    return {slot: _in_slot(slot) for slot in SLOTS}


def _in_slot(slot: str) -> dict[str, _ClassAndPreset]:
    """Return the registered algorithms that a slot may hold, by name."""
    base, kind = SLOTS[slot].base, SLOTS[slot].kind
    bases = tuple(other.base for other in SLOTS.values() if other.kind == kind)
    # Classes of another slot of this kind are not offered; classes of none are, so that the message says so.
    return {
        name: (cls, preset)
        for name, (cls, preset) in ALGORITHMS.of_kind(kind).items()
        if issubclass(cls, base) or not issubclass(cls, bases)
    }


def class_at(name: str, folders: tuple[Path, ...], problem: Callable[[str], Problem]) -> type[Any]:
    """Return the class that ``file.py:Class`` or ``module:Class`` names. Raises ConfigurationError if there is none.

    ``folders``: searched first. ``problem``: makes the fault from a message; modules beside its file, or in the working
    directory, are found too.
    """
    written = Path(problem("").source)
    folders = (*folders, written.parent if written.is_file() else Path.cwd())
    place, _, attribute = name.rpartition(":")
    path = Path(in_folders(place, folders))
    is_file = path.suffix == ".py"
    if is_file and not path.is_file():
        raise ConfigurationError([problem(f"no such file: {place}")])
    try:
        module = load_file(path, plugin_module(path)) if is_file else _module_at(place, folders)
    except (Exception, SystemExit) as error:
        if not is_file:
            raise ConfigurationError(
                [problem(f"{place} cannot be imported: {type(error).__name__}: {error}")]
            ) from error
        file, line, words = described(error, path)
        raise ConfigurationError([Problem(file, line or None, "", f"it raised {words}")]) from error
    found = getattr(module, attribute, None)
    if not isinstance(found, type):
        classes = [key for key, value in vars(module).items() if isinstance(value, type)]
        raise ConfigurationError([problem(f"{place} has no class {attribute!r}; {suggestion(attribute, classes)}")])
    return found


def _module_at(name: str, folders: tuple[Path, ...]) -> ModuleType:
    """Return the module of that name in the first of ``folders`` that has it, else as Python finds it."""
    top = name.partition(".")[0]
    for folder in folders:
        if (folder / f"{top}.py").is_file() or (folder / top).is_dir():
            with importable(folder):
                return import_module(name)
    return import_module(name)


def refuse_unfinished(algorithm: type[Any], base: type[Any], field: str) -> None:
    """Raise ConfigurationError for a class that is not a ``base``, or whose methods are missing or differ in
    signature.
    """
    missing = sorted(getattr(algorithm, "__abstractmethods__", ()))
    fault = "" if missing or not issubclass(algorithm, base) else signature_fault(algorithm, base)
    if issubclass(algorithm, base) and not missing and not fault:
        return
    source, line = inspect.getsourcefile(algorithm), inspect.getsourcelines(algorithm)[1]
    message = f"{algorithm.__name__} should be a subclass of {base.__module__}.{base.__name__}"
    if issubclass(algorithm, base):
        message = fault or f"{algorithm.__name__} does not define {', '.join(missing)}, as a {base.__name__} has to"
    raise ConfigurationError([Problem(str(source), line, field, message)])


def made_of_own(algorithm: type[Any], base: type[Any], field: str, *needs: Any, **given: Any) -> Any:
    """Return an instance of a user's class whose results are checked.

    Raises ConfigurationError, with the line in the user's file, if the class raises.
    """
    try:
        return with_checked_results(algorithm, base)(*needs, **given)
    except Exception as error:  # a user's class may raise anything
        source = inspect.getsourcefile(algorithm) or algorithm.__module__
        file, line, words = described(error, Path(source))
        message = f"{algorithm.__name__} cannot be made: {words}"
        raise ConfigurationError([Problem(file, line or None, field, message)]) from error


def _placed(config: RunConfig, slot: str, problem: Problem) -> Problem:
    """Return the problem of a parameter, with the place where the run was given it."""
    field = problem.field.split(".") if problem.field else []
    return config.problem(("algorithms", slot, *field), problem.message)
