"""``inside``: each goal's object is in the drawer, or on the inner board, that the goal names."""

from __future__ import annotations

from bestman_bt.evaluation.predicates.standing import is_over, rest_faults
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined


def inside(evidence: Evidence) -> Verdict:
    """Its middle is above the surface and below the next one above, let go and at rest; whichever way up.

    Whether the door or drawer is closed is asked by ``opening: {at_most: …}`` and the predicate ``opened``.
    """
    return joined(_inside(evidence, goal.object, goal.surface) for goal in evidence.session.setup.goals)


def _inside(evidence: Evidence, name: str, surface: str) -> Verdict:
    if name not in evidence.before:
        return Verdict(False, f"there is no {name} in the scene")
    faults = [] if is_over(evidence, name, surface) else [f"not inside {surface}"]
    faults += rest_faults(evidence, name, surface)
    return Verdict(not faults, f"the {name} is " + ", ".join(faults) if faults else "")
