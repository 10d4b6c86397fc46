"""What skills declare to touch is no collision, and nothing that they declare makes anything else none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from behaviours.contacts import Contact, grasp, handle, push, support
from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.evaluation.declared_contacts import AFTER, BEFORE, MOST_FORCE, ContactLog, Declared
from hal.simulation.audit_record import AuditRecord, ContactIncident

MODELS = {"cup": "cup", "can": "can", "counter_can": "can", "box": "box"}
FINGERS_ON_CUP = ContactIncident("left_finger", "cup", ("fingers", "object"), 1.0, 2.0, 40.0)
CUP_ON_TABLE = ContactIncident("cup", "table", ("object", "furniture"), 1.0, 1.5, 5.0)
FINGERS_ON_DRAWER = ContactIncident(
    "left_finger", "chest", ("fingers", "furniture"), 1.0, 2.0, 40.0, articulation="chest/drawer_1"
)


def judged(
    declared: Contact | Sequence[Declared],
    *contacts: ContactIncident,
    allowed: Sequence[tuple[str, str]] | None = None,
) -> Audit:
    """The audit of contacts, with one declaration from 0.9 to 1.6 s or with those given."""
    record = AuditRecord(10.0, 0, 0, 0, 0, {}, (), (), (), (), (), (), (), contacts, ())
    given = (Declared(declared, 0.9, 1.6),) if isinstance(declared, Contact) else tuple(declared)
    return audit(record, allowed, declared=given, models=MODELS)


def collisions(*arguments: Contact | Sequence[Declared] | ContactIncident) -> list[str]:
    """Why each contact is a collision."""
    return [collision.why for collision in judged(*arguments).collisions]


@pytest.mark.parametrize(
    ("declared", "contact"),
    [
        (grasp("cup"), FINGERS_ON_CUP),
        (push("cup"), FINGERS_ON_CUP),
        (support("cup", "table/top"), CUP_ON_TABLE),
        (support("cup", "table"), CUP_ON_TABLE),
        (support("cup", "floor"), replace(CUP_ON_TABLE, second="floor", kinds=("object", "floor"))),
        (handle("chest/drawer_1"), FINGERS_ON_DRAWER),
    ],
)
def test_a_declared_contact_is_no_collision_and_is_reported_with_its_skill_time_and_force(
    declared: Contact, contact: ContactIncident
) -> None:
    found = judged(replace(declared, skill="Main/Take"), contact)
    assert found.collisions == ()
    (told,) = found.to_document()["declared_contacts"]
    assert (told["skill"], told["kind"], told["peak_force_n"]) == ("Main/Take", declared.kind, contact.peak_force)
    assert (told["start_s"], told["end_s"], told["max_force_n"]) == (contact.start, contact.end, declared.max_force)
    first = contact.first if declared.kind == "support" else "fingers"
    assert told["pair"] == [first, contact.articulation or contact.second]


UNDECLARED = "no skill declared it"


@pytest.mark.parametrize(
    ("declared", "contact"),
    [
        (grasp("cup"), replace(FINGERS_ON_CUP, first="hand", kinds=("robot", "object"))),
        (push("cup"), replace(FINGERS_ON_CUP, first="arm_link_5", kinds=("robot", "object"))),
        (grasp("cup"), replace(FINGERS_ON_CUP, second="can")),
        (grasp("table"), replace(FINGERS_ON_CUP, second="table", kinds=("fingers", "furniture"))),
        (push("chest"), FINGERS_ON_DRAWER),
        (grasp("walker_1"), replace(FINGERS_ON_CUP, second="walker_1", kinds=("fingers", "walker"))),
        (grasp("floor"), replace(FINGERS_ON_CUP, second="floor", kinds=("fingers", "floor"))),
        (grasp("wall_1"), replace(FINGERS_ON_CUP, second="wall_1", kinds=("fingers", "wall"))),
        (handle("chest/drawer_1"), replace(FINGERS_ON_DRAWER, articulation="")),
        (handle("chest/drawer_1"), replace(FINGERS_ON_DRAWER, articulation="chest/drawer_2")),
        (handle("chest/drawer_1"), replace(FINGERS_ON_DRAWER, kinds=("robot", "furniture"))),
        (handle("chest"), FINGERS_ON_DRAWER),
        (handle(""), replace(FINGERS_ON_DRAWER, articulation="")),
        (support("cup", "table"), replace(CUP_ON_TABLE, second="shelf")),
        (support("cup", "table"), replace(CUP_ON_TABLE, first="can")),
        (support("cup", "can"), replace(CUP_ON_TABLE, second="can", kinds=("object", "object"))),
        (support("cup", "wall_1"), replace(CUP_ON_TABLE, second="wall_1", kinds=("object", "wall"))),
        (support("left_finger", "table"), replace(CUP_ON_TABLE, first="left_finger", kinds=("fingers", "furniture"))),
        (support("base_link", "table"), replace(CUP_ON_TABLE, first="base_link", kinds=("robot", "furniture"))),
    ],
)
def test_no_declaration_covers_other_links_objects_or_furniture(declared: Contact, contact: ContactIncident) -> None:
    assert collisions(declared, contact) == [UNDECLARED]
    assert judged(declared, contact).declared_contacts == ()


def test_no_declaration_covers_the_robot_itself() -> None:
    itself = replace(FINGERS_ON_CUP, second="hand", kinds=("fingers", "robot"))
    assert collisions(grasp("hand"), itself) == ["the robot collides with itself"]


@pytest.mark.parametrize(("force", "why"), [(20.0, []), (20.1, ["20 N were declared"])])
def test_a_contact_that_is_harder_than_declared_is_a_collision(force: float, why: list[str]) -> None:
    found = judged(grasp("cup", 20.0), replace(FINGERS_ON_CUP, peak_force=force))
    assert [collision.why for collision in found.collisions] == why
    assert found.declared_contacts[0]["peak_force_n"] == force
    assert len(found.faults(0.002)) == len(why)


def test_no_skill_can_raise_its_limit_without_end() -> None:
    assert collisions(grasp("cup", 1e9), replace(FINGERS_ON_CUP, peak_force=MOST_FORCE)) == []
    assert collisions(grasp("cup", 1e9), replace(FINGERS_ON_CUP, peak_force=MOST_FORCE + 1)) != []


@pytest.mark.parametrize(
    ("start", "end", "why"),
    [
        (0.95, 1.2, []),
        (1.5, 9.0, []),
        (1.6 + AFTER, 9.0, []),
        (0.89, 1.2, [UNDECLARED]),
        (1.61 + AFTER, 9.0, [UNDECLARED]),
    ],
)
def test_a_contact_must_begin_while_it_is_declared_and_may_last(start: float, end: float, why: list[str]) -> None:
    assert collisions(grasp("cup"), replace(FINGERS_ON_CUP, start=start, end=end)) == why


def test_all_fingers_that_hold_a_thing_hold_it_until_the_last_has_let_go() -> None:
    held = replace(FINGERS_ON_CUP, end=20.0)
    again = replace(FINGERS_ON_CUP, first="right_finger", start=15.0, end=25.0)
    later = replace(again, start=24.0, end=30.0, first="left_finger")
    anew = replace(again, start=31.0, end=32.0)
    assert collisions(grasp("cup"), held, again, later, anew) == [UNDECLARED]


def test_several_contacts_of_a_declaration_are_told_from_the_first_to_the_last_and_as_hard_as_at_most() -> None:
    right = replace(FINGERS_ON_CUP, first="right_finger", start=1.1, end=1.9, peak_force=5.0)
    for contacts in ((FINGERS_ON_CUP, right), (replace(right, start=0.95), FINGERS_ON_CUP)):
        (told,) = judged(grasp("cup"), *contacts).declared_contacts
        assert (told["start_s"], told["end_s"], told["peak_force_n"]) == (contacts[0].start, 2.0, 40.0)


def test_a_thing_is_known_by_its_looks_and_stands_for_one_object() -> None:
    other_can = replace(FINGERS_ON_CUP, second="counter_can")
    assert collisions(grasp("can"), other_can) == [], "of the same model: the robot cannot tell them apart"
    assert collisions(grasp("can"), other_can, replace(FINGERS_ON_CUP, second="can", start=1.2)) == [UNDECLARED]
    assert collisions(grasp("thing_1"), FINGERS_ON_CUP) == [], "what the robot has no name for"
    assert collisions(grasp("thing_1"), FINGERS_ON_CUP, replace(other_can, start=1.2)) == [UNDECLARED]
    assert collisions(grasp("box"), FINGERS_ON_CUP) == [UNDECLARED]


def test_a_task_narrows_what_skills_declare_and_widens_nothing() -> None:
    def found(allowed: Sequence[tuple[str, str]] | None, contact: ContactIncident = FINGERS_ON_CUP) -> list[str]:
        return [collision.why for collision in judged(grasp("cup"), contact, allowed=allowed).collisions]

    assert found(None) == found([("cup", "fingers")]) == found([("robot", "cup")]) == []
    assert found([("fingers", "can")]) == found([]) == ["the task does not allow it"]
    assert found([("fingers", "can")], replace(FINGERS_ON_CUP, second="can")) == [UNDECLARED]


class _Skills:
    """What is declared at the moment, and what time it is."""

    def __init__(self, hands: int = 1) -> None:
        self.active: list[Contact] = []
        self.time = 0.0
        self.log = ContactLog(lambda: self.active, lambda: self.time, hands)

    def at(self, time: float, *active: Contact) -> None:
        """A tick has ended."""
        self.time, self.active = time, list(active)
        self.log.after_tick()


def test_the_evaluation_notes_when_a_contact_is_declared() -> None:
    take, stand = grasp("cup"), support("cup", "table")
    skills = _Skills()
    for time, active in ((1.0, ()), (2.0, (take, stand)), (3.0, (take, stand)), (4.0, (take,)), (5.0, ())):
        skills.at(time, *active)
    assert [(one.contact, one.start, one.end) for one in skills.log.declared] == [
        (stand, 2.0 - BEFORE, 4.0),
        (take, 2.0 - BEFORE, 5.0),
    ]


def test_a_hand_handles_one_thing_at_a_time() -> None:
    cup, can, drawer = grasp("cup"), grasp("can"), handle("chest/drawer_1")
    for hands in (1, 2):
        skills = _Skills(hands)
        skills.at(1.0, cup, can, drawer, support("can", "table"))
        noted = {one.contact.thing for one in skills.log.declared if one.contact.kind != "support"}
        assert noted == {"cup", "can"} if hands == 2 else {"cup"}
