"""``tidied``: all objects that the task lists stand within a region."""

from __future__ import annotations

import numpy as np

from bestman_bt.evaluation.predicates.standing import rest_faults, surface_pose, tilt_fault
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined


def tidied(evidence: Evidence) -> Verdict:
    """The middle of each listed object that is there lies within the region; upright, let go, at rest.

    Metrics: ``outside_mm`` of the worst, 0 inside, and ``tidied_share``, of those that are there.
    """
    tidy = evidence.session.setup.config.task.tidy
    assert tidy is not None
    present = [name for name in tidy.objects if name in evidence.before]
    if not present:
        return Verdict(False, f"none of {', '.join(tidy.objects)} is in the scene")
    _, map_from_surface, _, room = surface_pose(evidence, tidy.surface)
    lower, upper = np.array([tidy.x[0], tidy.y[0]]), np.array([tidy.x[1], tidy.y[1]])
    verdicts, outside = [], []
    for name in present:
        pose = evidence.truth.object_pose(name)
        local = map_from_surface.inverse().apply(pose.position[None])[0]
        off = float(np.linalg.norm(np.maximum(np.maximum(lower - local[:2], local[:2] - upper), 0.0)))
        outside.append(1e3 * off)
        faults = [f"{1e3 * off:.0f} mm outside the region"] if off > 0.0 else []
        if not 0.0 < local[2] < room:
            faults.append(f"not above {tidy.surface}")
        faults += tilt_fault(evidence, pose)
        faults += rest_faults(evidence, name, tidy.surface)
        verdicts.append(Verdict(not faults, f"the {name} is " + ", ".join(faults) if faults else ""))
    told = joined(verdicts)
    share = sum(verdict.holds for verdict in verdicts) / len(verdicts)
    return Verdict(told.holds, told.why, {"outside_mm": max(outside), "tidied_share": share})
