"""Whether arms and bases can bear what is mounted on them, by their makers' words."""

from __future__ import annotations

from collections.abc import Mapping

from bestman_bt.configuration import Document, Problem
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.part_config import ArmPart, BasePart, LeggedBasePart
from bestman_bt.robot_model.payload import payload
from bestman_bt.robot_model.placed_part import PlacedPart


def load_problems(model: RobotModel, placed: Mapping[str, PlacedPart], document: Document) -> list[Problem]:
    """Arms that carry more than their payload beyond the tip, bases that carry more than theirs."""
    problems = []
    whole = payload(model, model.base_frame).mass
    for name, part in placed.items():
        limit = part.config.payload if isinstance(part.config, ArmPart | BasePart | LeggedBasePart) else None
        if limit is None:
            continue
        if isinstance(part.config, ArmPart):
            load = payload(model, part.config.tip).mass - part.mass_of([part.config.tip])
        else:
            load = whole - part.mass_of(part.links)
        if load > limit:
            message = f"{load:.3g} kg are mounted on it, more than its payload of {limit:.3g} kg"
            problems.append(document.problem(("parts", name), message))
    return problems
