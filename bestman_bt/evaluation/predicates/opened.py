"""``opened``: a door or drawer is as far open, or as far closed, as the task asks."""

from __future__ import annotations

import math

from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict


def opened(evidence: Evidence) -> Verdict:
    """``at_least`` ≤ how far it is open ≤ ``at_most``; metrics: ``angle_deg`` of a door, ``opening_mm`` of a drawer."""
    asked = evidence.session.setup.config.task.opening
    assert asked is not None
    furniture, _, part = asked.articulation.partition("/")
    piece = next(p for p in evidence.session.setup.world.furniture if p.name == furniture)
    leaf = next(a for a in piece.model.articulations if a.name == part)
    scale, unit, metric = (
        (math.degrees(1.0), "°", "angle_deg") if leaf.kind == "revolute" else (1e3, " mm", "opening_mm")
    )
    position = evidence.truth.articulation_position(asked.articulation)
    faults = []
    if asked.at_least is not None and position < asked.at_least:
        faults.append(f"at least {scale * asked.at_least:.0f}{unit} are asked")
    if asked.at_most is not None and position > asked.at_most:
        faults.append(f"at most {scale * asked.at_most:.0f}{unit} are asked")
    why = f"the {asked.articulation} is open by {scale * position:.1f}{unit}, {', '.join(faults)}" if faults else ""
    return Verdict(not faults, why, {metric: scale * position})
