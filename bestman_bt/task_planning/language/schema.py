"""Models of valid answers, generated from the abilities, so that nothing else can be expressed."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from bestman_bt.registry import suggestion
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic.problem import Operator, PlanningProblem

MOST_FACTS = 40
_MOST_FAULTS = 8


class GoalAnswer(BaseModel):
    """The goal of the instruction as facts. ``refusal``: why it cannot be planned. ``given_places``: where things are
    according to the instruction.
    """

    model_config = ConfigDict(extra="forbid")

    refusal: str | None = Field(None, description="null; or why this cannot or must not be done, in one sentence")
    goal: list[str] = Field(
        max_length=MOST_FACTS, description="what shall hold at the end: 'on(mug, table)', 'not open(drawer)'"
    )
    given_places: list[str] = Field(
        [], max_length=MOST_FACTS, description="where the instruction says that a thing is: 'on(mug, drawer)'"
    )


class PlannedStep(BaseModel):
    """One use of the ability ``ability``."""

    model_config = ConfigDict(extra="forbid")

    ability: str
    arguments: BaseModel

    @property
    def values(self) -> tuple[str, ...]:
        """Return the arguments in the order of the ability's parameters."""
        return tuple(str(getattr(self.arguments, name)) for name in type(self.arguments).model_fields)


class PlanAnswer(GoalAnswer):
    """A goal with the steps that achieve it; ``plan_answer`` makes the model for one problem."""

    plan: list[PlannedStep]


def plan_answer(problem: PlanningProblem, limits: PlanLimits) -> type[PlanAnswer]:
    """Return the model of plans for a problem: only abilities and names that the limits allow."""
    steps = [step for operator in limits.operators(problem) if (step := _step(operator, problem, limits)) is not None]
    entries: Any = reduce(or_, steps) if steps else PlannedStep
    if len(steps) > 1:
        entries = Annotated[entries, Field(discriminator="ability")]
    longest = limits.max_actions if steps else 0
    return create_model(
        "PlanAnswer", __base__=PlanAnswer, plan=(list[entries], Field(max_length=longest, description="in order"))
    )


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the schema for the strict mode of endpoints: every field required, only ``anyOf``."""
    return model.model_json_schema(schema_generator=_StrictSchema)


def faults_of(error: ValidationError) -> list[str]:
    """Return the first faults of an answer, as messages from which a model or a person can correct it."""
    found = error.errors(include_url=False)
    faults = [_fault(dict(entry)) for entry in found[:_MOST_FAULTS]]
    return faults if len(found) <= _MOST_FAULTS else [*faults, f"and {len(found) - _MOST_FAULTS} more"]


def _step(operator: Operator, problem: PlanningProblem, limits: PlanLimits) -> type[PlannedStep] | None:
    """Return the model of one ability's uses, or None if there is nothing of a type that it takes."""
    fields: dict[str, Any] = {}
    for number, (parameter, kind) in enumerate(operator.parameters.items()):
        names = limits.things(problem, kind)
        if not names:
            return None
        # The parameter's name is the alias alone: a field called ``copy`` or ``json`` would hide a method.
        fields[f"argument_{number}"] = (Literal[tuple(names)], Field(alias=parameter))
    arguments = create_model(f"{operator.name}Arguments", __config__=ConfigDict(extra="forbid"), **fields)
    named: dict[str, Any] = {"ability": (Literal[operator.name], ...), "arguments": (arguments, ...)}
    return create_model(operator.name, __base__=PlannedStep, **named)


class _StrictSchema(GenerateJsonSchema):
    def field_is_required(self, field: Any, total: bool) -> bool:
        return True

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> dict[str, Any]:
        return {"anyOf": super().tagged_union_schema(schema)["oneOf"]}

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])


def _fault(entry: dict[str, Any]) -> str:
    """Format one of pydantic's errors; the names of models, which are part of the path in a union, are omitted."""
    place = ""
    for part in entry["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif not (place.endswith("]") and part not in ("ability", "arguments")):
            place += f".{part}" if place else str(part)
    given, context = entry.get("input"), entry.get("ctx", {})
    match entry["type"]:
        case "literal_error" if isinstance(given, str):
            known = [name.strip("'") for name in str(context["expected"]).replace(" or ", ", ").split(", ")]
            said = f"{_short(given)} is not known here; {suggestion(given, known)}"
        case "union_tag_invalid":
            known = [name.strip("'") for name in str(context["expected_tags"]).split(", ")]
            said = f"there is no ability {_short(context['tag'])}; {suggestion(str(context['tag']), known)}"
        case "union_tag_not_found":
            said = "'ability' is missing"
        case _:
            said = str(entry["msg"])
    return f"{place}: {said}" if place else said


def _short(text: object) -> str:
    text = str(text)
    return repr(text if len(text) <= 60 else text[:60] + "…")
