"""Trees that execute a plan and replan when it fails."""

from __future__ import annotations

from collections.abc import Iterable

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import NodeRegistry, XmlElement, load_tree, tree_to_xml
from bestman_bt.task_planning.builders.plan_tree import TREE_ID, PlanTree
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic.problem import Literal

PLAN_AND_EXECUTE_FILE = "plan_and_execute.xml"
RUN_ID = "PlannedRun"


def with_replanning(
    made: PlanTree,
    goal: Iterable[Literal],
    planner: str,
    builder: str,
    registry: NodeRegistry,
    limits: PlanLimits | None = None,
    replans: int = 20,
) -> str:
    """Return a self-contained file: first the checked plan, then, if it fails, ``ReachGoal``. Raises TreeLoadError.

    ``limits``: of the new plans. ``replans``: number of plans after the first of these.
    """
    facts = " and ".join(str(literal) for literal in goal)
    as_planned = XmlElement("SubTree", {"ID": TREE_ID, "name": "as_planned"})
    entries = {"goal": facts, "planner": planner, "builder": builder, "limits": (limits or PlanLimits()).to_string()}
    entries["replans"] = str(replans)
    anew = XmlElement("SubTree", {"ID": "ReachGoal", "name": "anew", **entries})
    either = XmlElement("Fallback", {"name": "as_planned_or_anew"}, [as_planned, anew])
    document = made.document()
    document.root.attributes["main_tree_to_execute"] = RUN_ID
    document.root.content.insert(0, XmlElement("include", {"path": PLAN_AND_EXECUTE_FILE}))
    document.root.content.append(XmlElement("BehaviorTree", {"ID": RUN_ID}, [either]))
    return tree_to_xml(load_tree(document.to_xml(), registry, search_path=shipped_trees()))
