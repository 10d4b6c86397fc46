"""Hints for recovery name leaves that exist, for codes that the skill may fail with."""

from __future__ import annotations

import inspect
import re

import pytest

from behaviours import following
from behaviours.skill import Skill
from bestman_bt.registry import BEHAVIOURS

SKILLS = {name: found for name in BEHAVIOURS if issubclass(found := BEHAVIOURS.resolve(name), Skill)}
HINTED = sorted(name for name, skill in SKILLS.items() if skill.DECLARATION.recovery)
LEAF = re.compile(r"\b[A-Z][a-z]+(?:[A-Z][a-z]+)*\b")


@pytest.mark.parametrize("name", HINTED)
def test_every_hint_names_a_leaf_and_only_leaves_that_exist(name) -> None:
    for code, hint in SKILLS[name].DECLARATION.recovery.items():
        named = set(LEAF.findall(hint))
        assert named, f"{name} {code}: {hint!r} names no leaf"
        assert named <= set(BEHAVIOURS), f"{name} {code}: {named - set(BEHAVIOURS)}"


@pytest.mark.parametrize("name", sorted({"Grasp", "PlaceOn", "PlaceIn", "Push", "Open", "Close"}))
def test_skills_that_act_on_things_say_what_they_need_bring_about_and_how_to_go_on_after_failure(name) -> None:
    declared = SKILLS[name].DECLARATION
    assert declared.pre
    assert declared.effects
    assert declared.recovery


@pytest.mark.parametrize("name", sorted(set(HINTED) - {"Grasp"}))  # no_path of Grasp comes from the planner
def test_hinted_codes_are_told_somewhere_in_the_skill_or_what_it_derives_from(name) -> None:
    modules = [inspect.getmodule(base) for base in SKILLS[name].__mro__ if base.__module__.startswith("behaviours.")]
    if any(hasattr(module, "followed") for module in modules):
        modules.append(following)  # whose codes are told where going along ends early
    source = "".join(inspect.getsource(module) for module in modules if module is not None)
    for code in SKILLS[name].DECLARATION.recovery:
        assert source.count(f'"{code}"') > 1, f"{name} never fails with {code}"
