"""What the audit makes of a record: which counter each kind of finding goes to, and what is forgiven to whom."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from behaviours.contacts import Contact
from bestman_bt.evaluation.audit import CHEATS, LISTED, audit
from bestman_bt.evaluation.declared_contacts import Declared
from hal.simulation.audit_record import AuditRecord, ContactIncident, DisturbanceEvent, Finding, Penetration

NOTHING = AuditRecord(10.0, 0, 0, 0, 0, {}, (), (), (), (), (), (), (), (), ())
CONTACT = ContactIncident("panda_hand", "cup", ("robot", "object"), 1.0, 1.25, 40.0)
FINGER = ContactIncident("panda_leftfinger", "cup", ("fingers", "object"), 1.0, 2.0, 40.0)
WALKER = ContactIncident("base_link", "walker_1", ("robot", "walker"), 2.0, 3.0, 12.0, by_walker=True)
PUT = DisturbanceEvent(1.0, 1.0, "put", "cup", "a person moves the cup")
SLIP = DisturbanceEvent(2.0, 4.0, "slip", "can", "the can slips")


def findings(*stamps: float) -> tuple[Finding, ...]:
    return tuple(Finding(stamp, f"seen at {stamp:g}") for stamp in stamps)


def test_what_was_faked_is_reported_before_what_went_wrong() -> None:
    overlap = (Penetration("cup", "can", 0.045, 3.0),)
    seen = audit(replace(NOTHING, resets=3, truth_reads=15, jumps=findings(1, 2, 3, 4), penetrations=overlap))
    first, *others = seen.objections(0.002)
    assert first == "teleports 4, ground truth reads 15"
    assert others[:2] == ["1.00 s: seen at 1", "2.00 s: seen at 2"]
    assert others[3:] == ["…", "cup and can overlap by 45.00 mm, 2.00 are allowed"]
    assert audit(replace(NOTHING, penetrations=overlap)).objections(0.002) == tuple(others[-1:])


def test_a_record_of_nothing_is_honest_and_has_no_faults() -> None:
    judged = audit(NOTHING)
    document = judged.to_document()
    assert judged.honest
    assert judged.faults(0.0) == ()
    assert {value for value in document.values() if isinstance(value, int | float)} == {0}


def test_joints_beyond_their_limits_or_speeds_fail_an_episode() -> None:
    judged = audit(replace(NOTHING, joint_limits=findings(1), velocity_limits=findings(1, 2)))
    assert judged.faults(0.002) == (
        "joints were beyond their limits by more than 5 mrad or mm (1 times)",
        "joints were faster than their limits by more than 5 % (2 times)",
    )


@pytest.mark.parametrize("kind", ["robot", "fingers"])
@pytest.mark.parametrize("declared", [None, ()])
def test_a_robot_that_presses_on_itself_collides_whatever_is_allowed(kind: str, declared: tuple[()] | None) -> None:
    touch = ContactIncident("left_finger", "right_finger", ("fingers", kind), 1.0, 1.5, 9.0)
    allowed = [("left_finger", "right_finger"), ("fingers", "right_finger")]
    (found,) = audit(replace(NOTHING, contacts=(touch,)), allowed, declared=declared).collisions
    assert found.why == "the robot collides with itself"


def test_a_door_that_may_be_touched_is_not_its_cupboard() -> None:
    door = ContactIncident(
        "panda_leftfinger", "fridge", ("fingers", "furniture"), 1.0, 1.5, 9.0, articulation="fridge/door"
    )
    body = replace(door, articulation="", start=2.0, end=3.0)
    record = replace(NOTHING, contacts=(door, body))
    assert [one.start for one in audit(record, [("fingers", "fridge/door")]).collisions] == [2.0]
    assert audit(record, [("fingers", "fridge")]).collisions == ()


@pytest.mark.parametrize(
    ("seen", "counter", "count", "honest"),
    [
        ({"resets": 2}, "teleports", 2, False),
        ({"jumps": findings(1, 2, 3)}, "teleports", 3, False),
        ({"resets": 2, "jumps": findings(1)}, "teleports", 2, False),
        ({"constraints": 1}, "grasp_constraints", 1, False),
        ({"hidden_constraints": findings(1, 2)}, "grasp_constraints", 2, False),
        ({"truth_reads": 4}, "ground_truth_reads", 4, False),
        ({"tampering": 1}, "tampering", 1, False),
        ({"changes": findings(1, 2)}, "tampering", 2, False),
        ({"unexplained_forces": findings(1)}, "tampering", 1, False),
        ({"missed_looks": 5}, "tampering", 5, False),
        ({"open_hand": findings(1)}, "object_follows_open_hand", 1, False),
        ({"joint_limits": findings(1)}, "joint_limit_violations", 1, True),
        ({"velocity_limits": findings(1, 2)}, "velocity_limit_violations", 2, True),
        ({"contacts": (CONTACT,)}, "collisions", 1, True),
        ({"contacts": (WALKER,)}, "contacts_by_walkers", 1, True),
    ],
)
def test_each_kind_of_finding_goes_to_its_counter_alone_and_only_cheats_are_dishonest(
    seen: dict[str, Any], counter: str, count: int, honest: bool
) -> None:
    judged = audit(replace(NOTHING, **seen))
    counters = {name: value for name, value in judged.to_document().items() if isinstance(value, int) and value}
    assert counters == {counter: count}
    assert judged.honest is honest
    assert (counter in CHEATS) is not honest


def test_tampering_is_the_sum_of_all_its_kinds() -> None:
    record = replace(
        NOTHING, tampering=1, changes=findings(1, 2), unexplained_forces=findings(3), missed_looks=10, events=(PUT,)
    )
    assert audit(record).tampering == 1 + 2 + 1 + 10 + 1


def test_what_was_forgiven_must_be_what_the_script_has_done() -> None:
    record = replace(NOTHING, events=(PUT, SLIP))
    assert audit(record, script=(SLIP, PUT)).honest
    unasked = audit(record, script=(SLIP,))
    assert unasked.tampering == 1
    assert unasked.findings == ("1.00 s: not by the task's script: a person moves the cup",)
    hidden = audit(NOTHING, script=(SLIP,))
    assert hidden.tampering == 1
    assert hidden.findings == ("2.00 s: hidden from the monitor: the can slips",)
    later = replace(PUT, stamp=1.5)
    assert audit(replace(NOTHING, events=(PUT,)), script=(later,)).tampering == 2, "another time is another event"


def test_allowed_pairs_are_no_collisions_in_either_order() -> None:
    contacts = (
        FINGER,
        ContactIncident("cup", "table", ("object", "furniture"), 1.0, 1.1, 2.0),
        CONTACT,
        ContactIncident("cup", "can", ("object", "object"), 1.5, 1.6, 3.0),
    )
    record = replace(NOTHING, contacts=contacts)
    judged = audit(record, [("cup", "fingers"), ("table", "cup")])
    assert [(c.first, c.second, c.start, c.end, c.peak_force) for c in judged.collisions] == [
        ("panda_hand", "cup", 1.0, 1.25, 40.0),
        ("cup", "can", 1.5, 1.6, 3.0),
    ]
    assert judged.contacts_by_walkers == ()
    assert len(audit(record).collisions) == 4


@pytest.mark.parametrize(
    ("allowed", "finger", "hand"),
    [
        (("robot", "cup"), True, True),
        (("cup", "robot"), True, True),
        (("fingers", "cup"), True, False),
        (("panda_leftfinger", "cup"), True, False),
        (("panda_hand", "cup"), False, True),
        (("fingers", "can"), False, False),
        (("robot", "can"), False, False),
        (("cup", "can"), False, False),
    ],
)
def test_the_fingers_are_links_of_the_robot_but_the_robot_is_more_than_its_fingers(
    allowed: tuple[str, str], finger: bool, hand: bool
) -> None:
    for contact, forgiven in ((FINGER, finger), (CONTACT, hand)):
        assert (audit(replace(NOTHING, contacts=(contact,)), [allowed]).collisions == ()) is forgiven


def test_what_is_in_the_hand_may_not_touch_all_that_the_robot_may_touch() -> None:
    held = ContactIncident("cup", "table", ("cup", "table"), 1.0, 1.1, 2.0)
    record = replace(NOTHING, contacts=(held,))
    for allowed in (("robot", "table"), ("fingers", "table"), ("robot", "cup")):
        assert len(audit(record, [allowed]).collisions) == 1
    assert audit(record, [("cup", "table")]).collisions == ()


def test_a_walker_who_comes_into_the_robot_is_reported_and_is_no_fault_of_it() -> None:
    overlap = Penetration("base_link", "walker_1", 0.01, 2.5)
    less = Penetration("panda_hand", "cup", 0.0015, 1.0)
    judged = audit(replace(NOTHING, contacts=(WALKER,), penetrations=(overlap, less)))
    assert judged.faults(0.0016) == ()
    assert judged.max_penetration_mm == pytest.approx(1.5), "the next one that is the robot's own counts"
    assert judged.max_penetration_pair == ("panda_hand", "cup")
    (told,) = judged.to_document()["contacts_by_walkers_details"]
    assert told == {"pair": ["base_link", "walker_1"], "start_s": 2.0, "end_s": 3.0, "peak_force_n": 12.0}


@pytest.mark.parametrize("walker_first", [True, False])
def test_a_walkers_touch_does_not_excuse_an_overlap_after_the_robot_has_driven_into_the_same_walker(
    walker_first: bool,
) -> None:
    own = replace(WALKER, by_walker=False, start=6.0, end=7.0)
    contacts = (WALKER, own) if walker_first else (own, WALKER)
    overlap = Penetration("base_link", "walker_1", 0.01, 6.5)
    judged = audit(replace(NOTHING, contacts=contacts, penetrations=(overlap,)))
    assert judged.max_penetration_mm == pytest.approx(10.0)
    assert judged.faults(0.002) == (
        "collision of base_link with walker_1 (12.0 N)",
        "base_link and walker_1 overlap by 10.00 mm, 2.00 are allowed",
    )
    assert (len(judged.collisions), len(judged.contacts_by_walkers)) == (1, 1)


@pytest.mark.parametrize(("depth", "faulty"), [(0.00199, False), (0.00201, True)])
def test_an_overlap_is_a_fault_beyond_what_the_task_allows(depth: float, faulty: bool) -> None:
    shallow = Penetration("cup", "can", 0.0001, 1.0)
    judged = audit(replace(NOTHING, penetrations=(Penetration("cup", "table", depth, 1.0), shallow)))
    assert judged.max_penetration_pair == ("cup", "table")
    assert bool(judged.faults(0.002)) is faulty
    assert judged.to_document()["max_penetration_mm"] == round(1e3 * depth, 3)


def test_details_come_in_the_order_of_time_and_calls_first_and_no_more_than_a_page_of_each() -> None:
    record = replace(
        NOTHING,
        calls={"resetJointState": 3},
        missed_looks=2,
        velocity_limits=findings(0.5),
        jumps=findings(*range(1, LISTED + 10)),
        open_hand=findings(1.5),
        contacts=(CONTACT,) * (LISTED + 3),
        disturbances=findings(*range(LISTED + 4)),
    )
    judged = audit(record)
    assert judged.findings[:2] == (
        "resetJointState was called 3 times after the scene was built",
        "the monitor missed 2 observations",
    )
    assert judged.findings[2:5] == ("0.50 s: seen at 0.5", "1.00 s: seen at 1", "1.50 s: seen at 1.5")
    assert len(judged.findings) == 2 + LISTED
    document = judged.to_document()
    assert (document["collisions"], len(document["collision_details"])) == (LISTED + 3, LISTED)
    assert document["teleports"] == LISTED + 9
    assert len(document["disturbances"]) == LISTED
    assert document["collision_details"][0]["pair"] == ["panda_hand", "cup"]


def test_times_are_reported_relative_to_the_start_of_the_run() -> None:
    record = replace(NOTHING, jumps=findings(1.5), contacts=(CONTACT,), events=(PUT,), disturbances=findings(1.0))
    judged = audit(record, script=(PUT,), began=0.5)
    assert judged.findings == ("1.00 s: seen at 1.5",)
    assert judged.disturbances == ("0.50 s: seen at 1",)
    (collision,) = judged.collisions
    assert (collision.start, collision.end) == (0.5, 0.75)
    assert judged.tampering == 0
    held = Declared(Contact("grasp", "cup", 20.0), 0.9, 1.5)
    touch = replace(FINGER, peak_force=5.0)
    (told,) = audit(replace(NOTHING, contacts=(touch,)), declared=(held,), began=0.5).declared_contacts
    assert told["start_s"] == 0.5
