"""Tree builders: from plans to trees."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable
from typing import Any

from bestman_bt.engine import XmlElement
from bestman_bt.engine.own_files import defined_at, describe_error, signature_fault
from bestman_bt.registry import BUILDERS
from bestman_bt.task_planning.builders.plan_tree import PlanTree, Writer
from bestman_bt.task_planning.symbolic.problem import Formula, Literal, PlanningError, TaskPlan


class TreeBuilder(ABC):
    """Builds a tree from a plan; if the goal holds already, a tree that succeeds immediately."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Check the signature. Raises TypeError for a method that takes other arguments."""
        super().__init_subclass__(**options)
        if fault := signature_fault(cls, TreeBuilder):
            raise TypeError(fault)

    def build(self, plan: TaskPlan, goal: Iterable[Formula], leaves: Collection[str] = ()) -> PlanTree:
        """Return the tree of ``plan`` for the whole ``goal``; ``leaves``: abilities that are leaves, not subtrees.

        Raises PlanningError if the actions do not fit together, if ``root`` fails or does not return an element, or for
        formulas and conditional effects: build the tree of ``as_strips(problem, plan)`` then.
        """
        formulas = tuple(goal)
        literals = tuple(one for one in formulas if isinstance(one, Literal))
        writer, who = Writer(leaves), f"{type(self).__name__}.root"
        adl = [str(action) for action in plan.actions if action.any_of or action.when]
        adl += [str(formula) for formula in formulas if not isinstance(formula, Literal)]
        if adl:
            raise PlanningError(
                f"{adl[0]} has formulas or conditional effects; build the tree of what as_strips(problem, plan) returns"
            )
        try:
            element: object = self.root(plan, literals, writer) if plan.actions else writer.holds("goal", literals)
        except PlanningError:
            raise
        except Exception as error:  # a user's builder may raise anything; reported with its line
            raise PlanningError(f"{who} raised {describe_error(error)}") from error
        if not isinstance(element, XmlElement):
            place = defined_at(self.root)
            raise PlanningError(f"{who} should return an XmlElement, got {type(element).__name__} (at {place})")
        return PlanTree(plan, element)

    @abstractmethod
    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return the root of the tree; ``plan`` is not empty."""


def made_builder(name: str) -> TreeBuilder:
    """Return a tree builder by name. Raises UnknownNameError, or PlanningError if it is not one or cannot be
    created.
    """
    made: object = None
    found = BUILDERS.resolve(name)
    try:
        made = found()
    except Exception as error:  # of a third party: whatever it is, it is reported by name
        raise PlanningError(f"the tree builder {name!r} cannot be made: {describe_error(error)}") from error
    if not isinstance(made, TreeBuilder):
        raise PlanningError(f"the tree builder {name!r} should be a subclass of TreeBuilder, got {found!r:.100}")
    return made
