"""What task planners may order: leaves that declare parameters, and subtrees that declare themselves in their file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from behaviours.skill import Declaration, Skill
from bestman_bt.configuration.data import data_root
from bestman_bt.engine import NodeRegistry
from bestman_bt.engine.xml.documents import Documents, read_documents
from bestman_bt.task_planning.symbolic.facts import parse_conditions
from bestman_bt.task_planning.symbolic.problem import Condition, Forall, GoalError, Literal, Operator, PlanningError

FIELDS = ("pre", "hold", "effects", "cost", "parts")
"""What the metadata of a subtree declares; one that has none of them is no ability."""


class DeclarationError(PlanningError):
    """A leaf or a subtree declares what cannot be read."""


@dataclass(frozen=True)
class Ability:
    """``is_subtree``: whether trees call it as ``<SubTree ID=…>``. ``description``: what it does, in words."""

    operator: Operator
    is_subtree: bool
    description: str = ""

    @property
    def name(self) -> str:
        """The node's name, or the subtree's."""
        return self.operator.name


def shipped_abilities() -> Path:
    """The file of the subtrees that planners order."""
    return data_root() / "trees" / "subtrees" / "abilities.xml"


def abilities_of(registry: NodeRegistry, files: Iterable[Path] | None = None) -> tuple[Ability, ...]:
    """All abilities: of the subtrees in ``files`` (by default the shipped ones), then of the registry's leaves.

    Raises DeclarationError, and TreeLoadError where a file cannot be read.
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
    """What a leaf declares, as an operator; DeclarationError where its facts cannot be read."""
    parameters = dict(declared.parameters or {})
    pre, hold, effects = (
        _conditions(name, field, texts, parameters)
        for field, texts in (("pre", declared.pre), ("hold", declared.hold), ("effects", declared.effects))
    )
    facts = [effect for effect in effects if isinstance(effect, Literal)]
    if declared.cost <= 0.0:
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
    for name, metadata in documents.metadata.items():
        if not metadata.keys() & set(FIELDS):
            continue
        try:
            cost = float(metadata.get("cost", "1"))
        except ValueError:
            raise DeclarationError(f"{name}: cost is {metadata['cost']!r}; a number is accepted") from None
        declared = Declaration(
            pre=(metadata.get("pre", ""),),
            hold=(metadata.get("hold", ""),),
            effects=(metadata.get("effects", ""),),
            parameters={port.name: port.type for port in documents.models[name].values()},
            cost=cost,
            parts=tuple(metadata.get("parts", "").split()),
        )
        yield Ability(operator_of(name, declared), True, metadata.get("description", ""))


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
