"""The abilities of task planners: leaves that declare parameters, and subtrees that declare themselves in their
file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from behaviours.skill import Declaration, Skill
from bestman_bt.configuration.data import data_root
from bestman_bt.engine import NodeRegistry, TreeLoadError
from bestman_bt.engine.xml.documents import Documents, MetadataEntry, ModelPort, read_documents
from bestman_bt.errors import InputError
from bestman_bt.registry import suggestion
from bestman_bt.task_planning.symbolic.facts import parse_conditions
from bestman_bt.task_planning.symbolic.problem import Condition, Forall, GoalError, Literal, Operator, PlanningError

FIELDS = ("pre", "hold", "effects", "cost", "parts")
"""The declarations in the metadata of a subtree; a subtree without any is not an ability."""


class DeclarationError(PlanningError, InputError):
    """The declaration of a leaf or subtree cannot be parsed."""


@dataclass(frozen=True)
class Ability:
    """A skill or tree that planners can use. ``is_subtree``: whether trees call it as ``<SubTree ID=…>``."""

    operator: Operator
    is_subtree: bool
    description: str = ""

    @property
    def name(self) -> str:
        """The node's name, or the subtree's."""
        return self.operator.name


def shipped_abilities() -> Path:
    """Return the file of the shipped subtrees for planners."""
    return data_root() / "trees" / "subtrees" / "abilities.xml"


def abilities_of(registry: NodeRegistry, files: Iterable[Path] | None = None) -> tuple[Ability, ...]:
    """Return all abilities: of the subtrees in ``files`` (by default the shipped ones), then of the registry's leaves.

    Raises:
        DeclarationError: a declaration cannot be parsed.
        TreeLoadError: a file cannot be read.
    """
    found: dict[str, Ability] = {}
    for file in [shipped_abilities()] if files is None else files:
        for ability in _of_subtrees(read_documents(file)):
            found[ability.name] = ability
    for info in registry.manifest():
        if issubclass(info.cls, Skill) and info.cls.DECLARATION.parameters is not None:
            description = info.description.splitlines()[0] if info.description else ""
            found[info.name] = Ability(operator_of(info.name, info.cls.DECLARATION), False, description)
    return tuple(found.values())


def operator_of(name: str, declared: Declaration) -> Operator:
    """Return the operator of a leaf's declaration. Raises DeclarationError if its facts cannot be parsed."""
    parameters = dict(declared.parameters or {})
    pre, hold, effects = (
        _conditions(name, field, texts, parameters)
        for field, texts in (("pre", declared.pre), ("hold", declared.hold), ("effects", declared.effects))
    )
    facts = [effect for effect in effects if isinstance(effect, Literal)]
    if not 0.0 < declared.cost < math.inf:
        raise DeclarationError(f"{name}: cost is {declared.cost}; more than 0 is accepted")
    return Operator(
        name,
        parameters,
        pre,
        hold,
        add=tuple(effect.fact for effect in facts if not effect.negated),
        delete=tuple(effect.fact for effect in facts if effect.negated),
        each=tuple(effect for effect in effects if isinstance(effect, Forall)),
        cost=declared.cost,
        parts=declared.parts,
    )


def _of_subtrees(documents: Documents) -> Iterable[Ability]:
    faults = [problem for problem in documents.problems if problem.severity != "warning"]
    if faults:
        raise TreeLoadError(faults)
    for name, metadata in documents.metadata.items():
        if metadata.keys() & set(FIELDS):
            yield _of_subtree(name, metadata, documents.models[name])


def _of_subtree(name: str, metadata: Mapping[str, MetadataEntry], ports: Mapping[str, ModelPort]) -> Ability:
    for key, entry in metadata.items():
        if key not in (*FIELDS, "description"):
            raise DeclarationError(f"{_where(entry)}: {name}: unknown {key!r}; {suggestion(key, list(FIELDS))}")
        try:  # each by itself, so that the line of a fault is known
            operator_of(name, _declared(name, {key: entry.text}, ports))
        except DeclarationError as error:
            raise DeclarationError(f"{_where(entry)}: {error}") from error
    texts = {key: entry.text for key, entry in metadata.items()}
    return Ability(operator_of(name, _declared(name, texts, ports)), True, texts.get("description", ""))


def _declared(name: str, texts: Mapping[str, str], ports: Mapping[str, ModelPort]) -> Declaration:
    return Declaration(
        pre=(texts.get("pre", ""),),
        hold=(texts.get("hold", ""),),
        effects=(texts.get("effects", ""),),
        parameters={port.name: port.type for port in ports.values()},
        cost=_number(name, texts.get("cost", "1")),
        parts=tuple(texts.get("parts", "").split()),
    )


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DeclarationError(f"{name}: cost is {text!r}; a number is accepted") from None


def _where(entry: MetadataEntry) -> str:
    return f"{entry.file}:{entry.line}"


def _conditions(name: str, field: str, texts: Iterable[str], parameters: dict[str, str]) -> tuple[Condition, ...]:
    try:
        conditions = tuple(condition for text in texts for condition in parse_conditions(text))
    except GoalError as error:
        raise DeclarationError(f"{name}: {field}: {error}") from error
    for condition in conditions:
        for argument in _arguments(condition):
            if argument.startswith("{") and argument[1:-1] not in parameters:
                known = ", ".join(parameters) or "it has none"
                raise DeclarationError(f"{name}: {field}: {condition}: no parameter {argument}; {known}")
    return conditions


def _arguments(condition: Condition) -> Iterable[str]:
    if isinstance(condition, Literal):
        return condition.fact.arguments
    inner = (*(condition.given.arguments if condition.given else ()), *condition.then.fact.arguments)
    return [argument for argument in inner if argument != condition.variable]
