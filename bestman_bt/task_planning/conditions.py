"""Facts as condition leaves: the same functions that the symbolic state is read with."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.context import DRIVEN, SkillContext
from behaviours.names import ArticulationName, ObjectName, SurfaceName
from behaviours.skill import SkillCondition
from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.registry import PREDICATES, UnknownNameError
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import holds
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import GoalError

TUCKED = 0.1
"""Radians by which the joints of a tucked arm may be off its posture."""


class Holds(SkillCondition):
    """Whether facts are believed: ``on(mug, table/top) and not open(fridge/upper_door)``.

    ``{object}``, ``{place}`` and ``{container}`` in the text stand for the ports of these names.
    """

    USES = ("arm",)
    INPUT_PORTS: ClassVar = {
        "fact": PortInformation(str, description="facts, joined by and"),
        "object": BoundedPort(ObjectName, required=False, description="for {object} in the fact"),
        "place": BoundedPort(SurfaceName, required=False, description="for {place} in the fact"),
        "container": BoundedPort(ArticulationName, required=False, description="for {container} in the fact"),
    }
    FAILS: ClassVar = {
        "not_believed": "bring it about: Plan, ExecutePlan",
        "unknown_name": "name what there is on the map",
    }

    _brought_about: frozenset[str] | None = None

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        values = {f"{{{port}}}": self.get_input(port) for port in ("object", "place", "container")}
        beliefs = beliefs_of(self.skills)
        try:
            for literal in parse_literals(self.get_input("fact")):
                asked = literal.bound({port: name for port, name in values.items() if name})
                if holds(beliefs, asked.fact, self._declared(asked.fact.predicate)) == asked.negated:
                    return "not_believed", f"it is not believed that {asked}"
        except GoalError as error:
            return "bad_input", str(error)
        except (UnknownNameError, KeyError) as error:
            return "unknown_name", str(error.args[0])
        return None

    def _declared(self, predicate: str) -> frozenset[str]:
        """Predicates of abilities; they are only looked up for one that is not declared as such."""
        if self._brought_about is None and predicate not in PREDICATES.names():
            self._brought_about = frozenset(Domain.of(self.owner.registry).signatures)
        return self._brought_about or frozenset()


def beliefs_of(skills: SkillContext) -> Beliefs:
    """What a running robot believes, with what its encoders tell of the arm; one without an arm has none out."""
    if not skills.has("arm"):
        return Beliefs(skills.world, tucked=True)
    posture = skills.robot.posture(DRIVEN, skills.arm_model.joint_names)
    off = float(np.abs(skills.arm_positions() - posture).max())
    return Beliefs(skills.world, tucked=off <= TUCKED)
