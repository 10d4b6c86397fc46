"""``inside``: each goal's object is in the drawer, or on the inner board, that the goal names."""

from __future__ import annotations

import numpy as np

from bestman_bt.evaluation.predicates.standing import rest_faults, surface_pose
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined


def inside(evidence: Evidence) -> Verdict:
    """Its middle is above the surface and below the next one above, let go and at rest; whichever way up.

    Whether the door or drawer is closed is asked by ``opening: {at_most: …}`` and the predicate ``opened``.
    """
    return joined(_inside(evidence, goal.object, goal.surface) for goal in evidence.session.setup.goals)


def _inside(evidence: Evidence, name: str, surface: str) -> Verdict:
    if name not in evidence.before:
        return Verdict(False, f"there is no {name} in the scene")
    _, map_from_surface, size, room = surface_pose(evidence, surface)
    local = map_from_surface.inverse().apply(evidence.truth.object_pose(name).position[None])[0]
    within = bool(np.all(np.abs(local[:2]) <= np.array(size) / 2)) and 0.0 < local[2] < room
    faults = [] if within else [f"not inside {surface}"]
    faults += rest_faults(evidence, name, surface)
    return Verdict(not faults, f"the {name} is " + ", ".join(faults) if faults else "")
