"""Scenarios: the scripted or random behaviour of leaves in simulation, by path, name or type.

A scenario file is YAML with ``nodes`` (pattern → behaviour), ``default``, ``entries`` and ``enums``; files of
BehaviorTree.CPP with ``SubstitutionRules`` and ``TestNodeConfigs`` are accepted too.
"""

from __future__ import annotations

import fnmatch
import random
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Final

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import Port, key_of
from bestman_bt.engine.core.registry import NodeInfo, make_info
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.leaves.base import StatefulAction
from bestman_bt.engine.models.foreign import Placeholders
from bestman_bt.engine.models.node_models import PlaceholderControl, PlaceholderDecorator
from bestman_bt.engine.status import FAILURE, RUNNING, STATUS_NAMES, SUCCESS, NodeStatus
from bestman_bt.engine.substitution import SubstitutionError, SubstitutionRules
from bestman_bt.engine.xml.checking import Checker
from bestman_bt.errors import InputError

MAX_BYTES: Final = 1_000_000
_FIELDS: Final = ("result", "results", "success", "duration", "outputs")
_TOP: Final = ("nodes", "default", "entries", "enums")
_ROUNDING: Final = 1e-9


class ScenarioError(EngineError, InputError):
    """A scenario is invalid; the message has a line for each fault."""


@dataclass(frozen=True)
class LeafScript:
    """The behaviour of a leaf: ``results`` in turn, repeating the last; else ``success`` is the probability of SUCCESS.

    ``duration``: seconds of RUNNING before it, drawn between the two values. ``outputs``: values written on success, by
    port.
    """

    results: tuple[int, ...] = ()
    success: float = 0.8
    duration: tuple[float, float] = (0.0, 0.0)
    outputs: Mapping[str, Any] = field(default_factory=dict)

    def draw(self, turn: int, generator: random.Random) -> tuple[int, float]:
        """Return the result of turn ``turn``, counted from 0, and the seconds before it."""
        low, high = self.duration
        seconds = low if low == high else generator.uniform(low, high)
        if self.results:
            return self.results[min(turn, len(self.results) - 1)], seconds
        return SUCCESS if generator.random() < self.success else FAILURE, seconds


RANDOM_ACTION: Final = LeafScript(duration=(0.0, 3.0))
RANDOM_CONDITION: Final = LeafScript()


@dataclass(frozen=True)
class Scenario:
    """Rules by path (with ``*``), name or type; the first match applies, else ``default``, else random behaviour."""

    nodes: Mapping[str, LeafScript] = field(default_factory=dict)
    default: LeafScript | None = None
    entries: Mapping[str, Any] = field(default_factory=dict)
    enums: Mapping[str, int] = field(default_factory=dict)
    substitutions: SubstitutionRules | None = None

    @classmethod
    def load(cls, path: str | Path) -> Scenario:
        """Read a YAML or JSON file.

        Raises:
            ScenarioError: it does not exist, or is invalid; with the line if known.
        """
        import yaml  # where a scenario is read, not in each tree

        try:
            if Path(path).stat().st_size > MAX_BYTES:
                raise ScenarioError(f"{path}: it has more than {MAX_BYTES} bytes")
            text = Path(path).read_text("utf-8")
            if re.search(r"^[^#\n\"']*(?:[:\-\[,]\s*)[&*]\w", text, re.MULTILINE):
                raise ScenarioError(f"{path}: anchors and aliases are not read")
            data = yaml.safe_load(text)
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = f":{mark.line + 1}" if mark is not None else ""
            raise ScenarioError(f"{path}{line}: it is not YAML: {getattr(error, 'problem', error)}") from None
        except (OSError, UnicodeError, RecursionError) as error:
            raise ScenarioError(f"{path}: it cannot be read: {error}") from None
        return cls.from_mapping(data, str(path))

    @classmethod
    def from_mapping(cls, data: Any, file: str = "the scenario") -> Scenario:
        """Check the content of a scenario file and return the scenario.

        Raises:
            ScenarioError: listing every fault.
        """
        if not isinstance(data, Mapping):
            raise ScenarioError(f"{file}: it should be a mapping with {', '.join(_TOP)}, got {data!r:.60}")
        if "SubstitutionRules" in data:
            try:
                return cls(substitutions=replace(SubstitutionRules.from_json(data), file=file))
            except SubstitutionError as error:
                raise ScenarioError(f"{file}: {error}") from None
        faults = [f"{file}: {key}: unknown; known are {', '.join(_TOP)}" for key in data if key not in _TOP]
        parts = [key for key in ("nodes", "entries", "enums") if not isinstance(data.get(key) or {}, Mapping)]
        faults += [f"{file}: {key}: should be a mapping, got {data[key]!r:.60}" for key in parts]
        if faults:
            raise ScenarioError("\n".join(faults))
        nodes = {str(k): _script(v, f"{file}: nodes.{k}", faults) for k, v in (data.get("nodes") or {}).items()}
        default = _script(data["default"], f"{file}: default", faults) if "default" in data else None
        enums = dict(data.get("enums") or {})
        faults += [
            f"{file}: enums.{k}: should be a whole number, got {v!r}" for k, v in enums.items() if type(v) is not int
        ]
        if faults:
            raise ScenarioError("\n".join(faults))
        return cls(nodes, default, dict(data.get("entries") or {}), enums)

    def script_of(self, node: Node) -> LeafScript:
        """Return the behaviour of a leaf."""
        for pattern, script in self.nodes.items():
            if fits(pattern, node):
                return script
        return self.default or (
            RANDOM_CONDITION if node.info is not None and node.info.kind == "Condition" else RANDOM_ACTION
        )


def fits(pattern: str, node: Node) -> bool:
    """Return whether a pattern matches a node: its name, its type, or its path with ``*`` as a wildcard."""
    return pattern in (node.name, node.type_id) or fnmatch.fnmatchcase(node.path, pattern.replace("[", "[[]"))


def _script(data: Any, where: str, faults: list[str]) -> LeafScript:
    if isinstance(data, str):
        data = {"result": data}
    if not isinstance(data, Mapping):
        faults.append(f"{where}: should be a result or a mapping with {', '.join(_FIELDS)}, got {data!r:.60}")
        return LeafScript()
    faults += [f"{where}.{key}: unknown; known are {', '.join(_FIELDS)}" for key in data if key not in _FIELDS]
    results: list[int] = []
    given = data.get("results", [data["result"]] if "result" in data else [])
    for name in given if isinstance(given, list) else [given]:
        if name in STATUS_NAMES[1:]:
            results.append(STATUS_NAMES.index(name))
        else:
            faults.append(f"{where}: a result should be {', '.join(STATUS_NAMES[1:])}, got {name!r:.60}")
    success = data.get("success", LeafScript.success)
    if not _is_number(success) or not 0 <= success <= 1:
        faults.append(f"{where}.success: should be a chance from 0 to 1, got {success!r:.60}")
    duration = data.get("duration", 0.0)
    pair = duration if isinstance(duration, list) else [duration, duration]
    if len(pair) != 2 or not all(map(_is_number, pair)) or not 0 <= pair[0] <= pair[1] < float("inf"):
        faults.append(f"{where}.duration: should be seconds, or [least, most], got {duration!r:.60}")
        pair = [0.0, 0.0]
    outputs = data.get("outputs") or {}
    if not isinstance(outputs, Mapping):
        faults.append(f"{where}.outputs: should be a mapping of ports, got {outputs!r:.60}")
        outputs = {}
    return LeafScript(tuple(results), success, (float(pair[0]), float(pair[1])), dict(outputs))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


@dataclass
class RandomOutcomes:
    """The scenario and random generator of simulated leaves."""

    scenario: Scenario
    generator: random.Random


class SimulatedAction(StatefulAction):
    """A simulated leaf; its behaviour comes from the ``RandomOutcomes`` of its class."""

    improvisation: ClassVar[RandomOutcomes]

    def on_load(self) -> None:
        """Look up the behaviour."""
        self.script = self.improvisation.scenario.script_of(self)
        self.turn = 0
        self.end = 0.0
        self.result = SUCCESS

    def on_start(self) -> int:
        """Draw a result and its duration."""
        self.result, seconds = self.script.draw(self.turn, self.improvisation.generator)
        self.turn += 1
        if seconds <= 0:
            return self._done()
        self.end = self.clock.now() + seconds
        return RUNNING

    def on_running(self) -> int:
        """Complete when the duration is over."""
        return self._done() if self.clock.now() >= self.end - _ROUNDING else RUNNING

    def _done(self) -> int:
        if self.result == SUCCESS:
            info = self.owner.info_of(self)
            for port in info.outputs:
                self._write(port)
        return self.result

    def _write(self, port: Port) -> None:
        key = key_of(self.attributes.get(port.name, port.default), port.name)
        if port.name in self.script.outputs:
            self.set_output(port.name, self.script.outputs[port.name])
        elif key is not None and self.board.slot(key).value is None:
            self.set_output(port.name, plausible_value(port))


class SimulatedCondition(SimulatedAction):
    """A simulated condition."""

    KIND: ClassVar[str] = "Condition"


def plausible_value(port: Port) -> Any:
    """Return a plausible value for an entry that has none, from the name of the port's type."""
    if port.data_type is NodeStatus:
        return NodeStatus(SUCCESS)
    name = port.type_name.lower()
    if any(word in name for word in ("vector", "list", "queue", "[]", "path")):
        return []
    if "bool" in name:
        return True
    if "string" in name or name == "str":
        return f"simulated {port.name}"
    return 0


_STANDING_FOR: Final[dict[str, type[Node]]] = {
    "Action": SimulatedAction,
    "Condition": SimulatedCondition,
    "Control": PlaceholderControl,
    "Decorator": PlaceholderDecorator,
}


class SimulatedLeaves(Placeholders):
    """Replaces all nodes other than the engine's own, or only ``missing`` ones, by simulated nodes.

    A simulated control node ticks its children as a Sequence; a simulated decorator returns its child's result.
    """

    def __init__(self, scenario: Scenario, seed: int, *, missing: bool = False) -> None:
        super().__init__()
        self.missing = missing
        asked = {"improvisation": RandomOutcomes(scenario, random.Random(seed))}  # noqa: S311 - no secrets
        self._kinds = {kind: type(cls.__name__, (cls,), asked) for kind, cls in _STANDING_FOR.items()}
        self.simulated: dict[str, str] = {}
        self._infos: dict[int, tuple[NodeInfo, NodeInfo]] = {}

    def fill(self, checker: Checker) -> None:
        """Replace the leaves."""
        super().fill(checker)
        for definition in checker.documents.trees.values():
            for element in definition.element.iter():
                info = element.info
                if info is not None and not info.builtin and (info.known_from or not self.missing):
                    element.info = self._simulated(info)
                    element.entries = [(port, key, Any) for port, key, _ in element.entries or ()] or None

    def _simulated(self, info: NodeInfo) -> NodeInfo:
        found = self._infos.get(id(info))
        if found is None:
            self.simulated[info.name] = info.known_from or "the registry"
            made = make_info(info.name, self._kinds[info.kind], builtin=False)
            ports = {
                port.name: replace(port, data_type=Any, required=False, bounds=None, written_type=port.type_name)
                for port in info.ports.values()
            }
            made = replace(
                made, ports=ports, description=info.description, known_from=info.known_from or "the registry"
            )
            found = self._infos[id(info)] = (info, made)
        return found[1]
