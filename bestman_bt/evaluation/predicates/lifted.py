"""``lifted``: an object is in the hand, above where it stood, and stays there."""

from __future__ import annotations

import numpy as np

from bestman_bt.evaluation.predicates.standing import AT_REST
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict


def lifted(evidence: Evidence) -> Verdict:
    """Touched by the robot and by nothing else, as high as asked, at rest; metric: ``lifted_mm``."""
    asked = evidence.session.setup.config.task.lift
    assert asked is not None
    name, truth = asked.object, evidence.truth
    if name not in evidence.before:
        return Verdict(False, f"there is no {name} in the scene")
    stood = next(thing.pose for thing in evidence.session.setup.world.objects if thing.name == name)
    pose = truth.object_pose(name)
    height = float(pose.position[2] - stood.position[2])
    faults = []
    if height < asked.height:
        faults.append(f"{1e3 * height:.0f} mm above where it stood, {1e3 * asked.height:.0f} mm are asked")
    if not truth.touches_robot(name):
        faults.append("not in the hand")
    faults += [f"touching the {other}" for other in truth.supports(name)]
    if float(np.linalg.norm(pose.position - np.array(evidence.before[name]))) > AT_REST:
        faults.append("still moving")
    return Verdict(not faults, f"the {name} is " + ", ".join(faults) if faults else "", {"lifted_mm": 1e3 * height})
