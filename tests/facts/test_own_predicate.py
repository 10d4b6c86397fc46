"""A predicate is one file: leaves, planners and the judge of a run have it from there."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.facts.predicate import Beliefs, shipped_predicates
from bestman_bt.messages import Pose
from bestman_bt.registry import PREDICATES, undone
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import holds, known_predicates
from bestman_bt.task_planning.symbolic.problem import Fact
from tests.facts.scripted import ScriptedEnd

LYING = '''
"""Whether a thing has fallen over."""

from bestman_bt.facts.predicate import Predicate


def lies(beliefs, name):
    belief = beliefs.world.objects.get(name)
    return belief is not None and belief.pose.tilt > 0.5


def stands(evidence, name):
    return "" if evidence.truth.object_pose(name).tilt > 0.5 else f"the {name} stands"


LYING = Predicate("lying", {"object": "object"}, "the {object} lies on its side", lies, why_not=stands)
'''


@pytest.fixture
def lying(tmp_path: Path) -> Iterator[Path]:
    file = tmp_path / "lying.py"
    file.write_text(LYING)
    with undone(PREDICATES):
        yield file


def test_a_file_of_a_user_brings_a_predicate_to_planners_conditions_and_the_judge(lying: Path) -> None:
    registry = node_registry([str(lying)])
    assert Domain.of(registry).signatures["lying"] == ("object",)
    end = ScriptedEnd("plan_put_away", told=("goals.0.facts.goal=lying(cup) and located(cup)",))
    assert not holds(Beliefs(end.setup.world_model), Fact("lying", ("cup",)))
    verdict = end.verdict("facts")
    assert verdict.why == "the cup stands"
    assert verdict.metrics == {"facts_judged": 1, "facts_share": 0.0}
    end.put("cup", end.truth.poses["cup"] @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0)))
    assert end.verdict("facts").holds


def test_a_predicate_whose_judgement_raises_is_not_true_and_its_line_is_reported(lying: Path) -> None:
    lying.write_text(LYING.replace('f"the {name} stands"', "1 / 0"))
    node_registry([str(lying)])
    verdict = ScriptedEnd("plan_put_away", told=("goals.0.facts.goal=lying(cup)",)).verdict("facts")
    assert not verdict.holds
    assert "raised ZeroDivisionError" in verdict.why
    assert f"{lying}:13" in verdict.why


def test_a_file_beside_the_shipped_ones_is_shipped(lying: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else names it: not the registry, not the judge."""
    import bestman_bt.facts

    monkeypatch.setattr(bestman_bt.facts, "__path__", [*bestman_bt.facts.__path__, str(lying.parent)])
    assert shipped_predicates().keys() == {*known_predicates(), "lying"}
    sys.modules.pop("bestman_bt.facts.lying")
