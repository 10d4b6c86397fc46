"""When somebody disturbs, and where: the script of a task's disturbances on a truth that a test writes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import ManualClock
from bestman_bt.evaluation.disturbances import Disturbances, RelocationSampler
from bestman_bt.messages import Pose
from bestman_bt.scene.placing import planar_radius
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief
from hal.simulation.audit_record import DisturbanceEvent
from tests.facts.scripted import ScriptedEnd, shifted

PERIOD = 0.05
CLEARANCE, EDGE, REACH = 0.08, 0.04, 0.35
DRAWER = "drawer_chest/drawer_3"
ASKEW = "scene.furniture.drawer_chest.at=[1.4, 0.3, 115 deg]"


class ScriptedDisturber:
    """Writes down what is to be done, and when; the first ``refusals`` times something is in the way."""

    def __init__(self, clock: ManualClock, refusals: int = 0) -> None:
        self._clock, self.refusals = clock, refusals
        self.asked: list[tuple[float, str, Any]] = []

    def move_object(self, name: str, pose: Pose, surface: str) -> DisturbanceEvent | None:
        return self._do("put", name, (pose, surface))

    def push_shut(self, articulation: str, speed: float) -> DisturbanceEvent | None:
        return self._do("push", articulation, speed)

    def let_slip(self, name: str) -> DisturbanceEvent | None:
        return self._do("slip", name, None)

    def _do(self, kind: Any, name: str, what: Any) -> DisturbanceEvent | None:
        now = self._clock.now()
        self.asked.append((now, name, what))
        return None if len(self.asked) <= self.refusals else DisturbanceEvent(now, now, kind, name, f"{kind} {name}")


class Stage(ScriptedEnd):
    """A world in which nothing moves but by the hand of a test; the robot's hand is far away."""

    def __init__(self, task: str, disturbances: str, *settings: str, seed: int = 3, refusals: int = 0) -> None:
        super().__init__(task, *settings, seed=seed, told=(f"disturbances={disturbances}", "predicate=null"))
        self.clock = ManualClock(100.0)
        self.session.robot = type("Robot", (), {"clock": self.clock})()
        self.world = self.session.skills.world
        self.truth.frames[self.tool_frame] = Pose(np.array([0.0, 0.0, 9.0]))
        self.injector = ScriptedDisturber(self.clock, refusals)
        session: Any = self.session
        truth: Any = self.truth
        injector: Any = self.injector
        self.script = Disturbances(session, truth, injector)

    def believe(self, name: str) -> None:
        pose = self.truth.poses[name]
        self.world.objects[name] = ObjectBelief(name, self.world.models[name], pose, 1.0, 0.002, 0.0)

    def hand_at(self, point: np.ndarray) -> None:
        self.truth.frames[self.tool_frame] = Pose(point)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.script.after_tick()
            self.clock.advance(PERIOD)

    def acts_after(self, seconds: float) -> list[float]:
        """When, from now on, the injector was asked for something."""
        begin = self.clock.now()
        self.wait(seconds)
        return [round(stamp - begin, 3) for stamp, *_ in self.injector.asked if stamp >= begin]


MOVED = "{kind: moved, object: cup, distance: [10 cm, 12 cm], after: [1 s, 3 s]}"


def test_the_seed_draws_when_and_each_disturbance_of_a_task_has_its_own_time() -> None:
    delays = []
    for seed in range(3, 9):
        stage = Stage("plan_swap", f"[{MOVED}, {MOVED}]", seed=seed)
        stage.believe("cup")
        first, second = stage.acts_after(4.0)
        delays += [first, second]
        again = Stage("plan_swap", f"[{MOVED}, {MOVED}]", seed=seed)
        again.believe("cup")
        assert again.acts_after(4.0) == [first, second]
    assert len(set(delays)) > 8
    assert 1.0 <= min(delays) < 1.7
    assert 2.3 < max(delays) <= 3.0 + PERIOD


def test_the_seed_draws_where() -> None:
    places = set()
    for seed in range(3, 7):
        stage = Stage("plan_swap", f"[{MOVED}]", seed=seed)
        stood = stage.truth.poses["cup"].position
        stage.believe("cup")
        stage.wait(4.0)
        ((_, name, (pose, surface)),) = stage.injector.asked
        assert (name, surface) == ("cup", "table/top")
        assert 0.10 <= np.linalg.norm((pose.position - stood)[:2]) <= 0.12
        places.add(round(math.atan2(*(pose.position - stood)[:2]), 3))
    assert len(places) == 4


def test_a_deed_is_done_once_and_one_that_was_in_the_way_is_tried_again_after_a_second() -> None:
    stage = Stage("plan_swap", "[{kind: moved, object: cup, after: [0, 0]}]", refusals=2)
    stage.believe("cup")
    assert stage.acts_after(5.0) == pytest.approx([0.0, 1.0, 2.0], abs=0.11)
    (event,) = stage.script.events
    assert event.text == "put cup"


def test_nothing_is_done_before_the_robot_has_seen_it_and_nothing_after_it_was_in_the_hand() -> None:
    stage = Stage("plan_swap", "[{kind: moved, object: cup, after: [0, 0]}]")
    assert stage.acts_after(1.0) == []
    stage.world.hands["arm"] = HeldObject("can", stage.world.models["cup"], Pose(), 0.05)
    stage.believe("cup")
    assert stage.acts_after(PERIOD) == [0.0], "another thing in the hand is no reason to wait"
    stage = Stage("plan_swap", "[{kind: moved, object: cup, after: [0, 0]}]")
    stage.world.hands["arm"] = HeldObject("cup", stage.world.models["cup"], Pose(), 0.05)
    stage.wait(PERIOD)
    stage.world.hands.clear()
    stage.believe("cup")
    assert stage.acts_after(2.0) == []


@pytest.mark.parametrize(
    ("linear", "angular", "tilt", "hand", "acts"),
    [
        (0.009, 0.09, 9.9, 0.61, True),
        (0.011, 0.0, 0.0, 9.0, False),
        (0.0, 0.11, 0.0, 9.0, False),
        (0.0, 0.0, 10.1, 9.0, False),
        (0.0, 0.0, 0.0, 0.59, False),
    ],
)
def test_somebody_waits_until_a_thing_rests_upright_and_the_hand_is_away(
    linear: float, angular: float, tilt: float, hand: float, acts: bool
) -> None:
    stage = Stage("plan_swap", "[{kind: moved, object: cup, after: [0, 0]}]")
    stage.believe("cup")
    pose = stage.truth.poses["cup"]
    stage.truth.poses["cup"] = pose @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, math.radians(tilt), 0.0))
    stage.truth.speeds["cup"] = (linear, angular)
    stage.hand_at(pose.position + np.array([0.0, 0.6, 0.8]) * hand)
    assert bool(stage.acts_after(1.0)) is acts
    if not acts:  # and goes on once that is so
        stage.truth.poses["cup"], stage.truth.speeds = pose, {}
        stage.hand_at(pose.position + np.array([0.0, 0.0, 9.0]))
        assert stage.acts_after(PERIOD) == [0.0]


@pytest.mark.parametrize(
    ("up", "beside", "touched", "acts"),
    [
        (0.031, 0.0, True, True),
        (0.031, 0.099, True, True),
        (0.029, 0.0, True, False),
        (0.031, 0.101, True, False),
        (0.031, 0.0, False, False),
    ],
)
def test_a_grasp_slips_once_the_thing_is_lifted_and_still_above_where_it_stood(
    up: float, beside: float, touched: bool, acts: bool
) -> None:
    stage = Stage("plan_swap", "[{kind: slips, object: cup, after: [0, 0]}]")
    stood = stage.truth.poses["cup"]
    lifted = shifted(stood, beside * 0.6, -beside * 0.8, up)
    stage.truth.touched.add("cup")
    stage.truth.poses["cup"] = lifted
    assert stage.acts_after(0.2) == [], "nobody knows yet where it stood"
    stage.truth.touched.clear()
    stage.put("cup", shifted(stood, 0.5), "table")
    stage.wait(0.1)
    stage.put("cup", stood, "table")
    stage.wait(0.1)
    stage.put("cup", lifted)
    if touched:
        stage.truth.touched.add("cup")
    assert bool(stage.acts_after(0.2)) is acts


@pytest.mark.parametrize(
    ("task", "name", "opened", "speed", "settings"),
    [
        ("put_away", DRAWER, 0.28, 0.25, (ASKEW,)),
        ("open_fridge", "fridge/upper_door", 1.6, 0.8, ("scene.furniture.fridge.at=[1.6, 0.2, 40 deg]",)),
    ],
)
def test_what_was_opened_is_pushed_shut_once_the_hand_is_out_of_it(
    task: str, name: str, opened: float, speed: float, settings: tuple[str, ...]
) -> None:
    def opened_stage(believed: float, true: float, hand: float) -> Stage:
        asked = f"[{{kind: shut, articulation: {name}, after: [0, 0]}}]"
        stage = Stage(task, asked, *settings)
        piece = next(piece for piece in stage.setup.world.furniture if piece.name == name.split("/")[0])
        door = next(door for door in piece.model.articulations if door.name == name.split("/")[1])
        stage.world.articulations[name] = believed
        stage.truth.opened[name] = true
        handle = piece.pose @ door.moved(true) @ door.handle.pose
        stage.hand_at(handle.position + np.array([0.0, 0.0, hand]))
        return stage

    shut = opened_stage(opened, opened, 0.36)
    shut.wait(PERIOD)
    ((_, pushed, at_speed),) = shut.injector.asked
    assert (pushed, at_speed) == (name, speed)
    assert opened_stage(opened, opened, 0.34).acts_after(1.0) == []
    assert opened_stage(0.02, opened, 9.0).acts_after(1.0) == [], "the robot does not believe that it is open"
    assert opened_stage(opened, 0.001, 9.0).acts_after(1.0) == [], "it is shut already"


def test_a_drawer_is_not_shut_any_more_once_its_object_was_in_the_hand() -> None:
    for held, acts in (("cup", False), (None, True)):
        stage = Stage("put_away", f"[{{kind: shut, articulation: {DRAWER}, object: cup, after: [0, 0]}}]")
        stage.world.hands = {} if held is None else {"arm": HeldObject(held, stage.world.models["cup"], Pose(), 0.05)}
        stage.wait(PERIOD)
        stage.world.hands.clear()
        stage.world.articulations[DRAWER] = stage.truth.opened[DRAWER] = 0.28
        assert bool(stage.acts_after(0.5)) is acts


def test_a_disturbance_of_a_thing_that_the_seed_has_left_out_is_none() -> None:
    absent = "scene.objects.cup=absent"
    stage = Stage("fetch_cup", "[{kind: slips, object: cup}, {kind: moved, object: can}]", absent)
    stage.believe("can")
    stage.wait(1.0)
    assert {name for _, name, _ in stage.injector.asked} == {"can"}


@pytest.mark.slow
def test_things_are_put_near_enough_on_their_surface_and_clear_of_others_and_of_goals() -> None:
    end = ScriptedEnd("pick_place_table", "scene.furniture.table.at=[2.6, -0.4, 50 deg]")
    session: Any = end.session
    truth: Any = end.truth
    places = RelocationSampler(session, truth)
    models = {thing.name: thing.model for thing in end.setup.world.objects}
    name = next(name for name, model in models.items() if model.symmetry_order == 0)
    end.truth.on[name] = ("table",)
    piece = next(piece for piece in end.setup.world.furniture if piece.name == "table")
    (surface,) = piece.model.surfaces
    from_map = end.surface("table/top").inverse()
    stood = end.truth.poses[name].position
    radius = planar_radius(models[name])
    drawn = [places.beside(name, (0.1, 0.4), np.random.default_rng(seed)) for seed in range(150)]
    assert all(place is not None and place.surface == "table/top" for place in drawn)
    poses = [place.pose for place in drawn if place is not None]
    ways = [float(np.linalg.norm((pose.position - stood)[:2])) for pose in poses]
    assert 0.1 <= min(ways) < 0.15
    assert 0.3 < max(ways) <= 0.4
    local = np.array([(from_map @ pose).position for pose in poses])
    np.testing.assert_allclose(local[:, 2], models[name].size[2] / 2, atol=2e-3)
    assert (np.abs(local[:, :2]) + radius + EDGE <= np.array(surface.size) / 2 + 1e-9).all()
    assert (local[:, 0] + surface.size[0] / 2 < REACH).all()
    assert max(pose.tilt for pose in poses) < 1e-6
    assert np.ptp([pose.yaw for pose in poses]) > 4.0
    kept = [(end.truth.poses[other], model) for other, model in models.items() if other != name]
    kept += [(pose, models[name]) for pose in end.setup.world.goals.values()]
    gaps = [
        float(np.linalg.norm((pose.position - other.position)[:2])) - radius - planar_radius(model)
        for pose in poses
        for other, model in kept
        if model.symmetry_order == 0
    ]
    assert CLEARANCE - 1e-3 <= min(gaps) < CLEARANCE + 0.03


def test_where_there_is_no_room_there_is_no_place() -> None:
    end = ScriptedEnd("pick_place_table")
    session: Any = end.session
    truth: Any = end.truth
    name = next(iter(end.truth.poses))
    assert RelocationSampler(session, truth).beside(name, (5.0, 6.0), np.random.default_rng(1)) is None
    end.truth.poses[name] = shifted(end.truth.poses[name], z=-0.5)
    assert RelocationSampler(session, truth).beside(name, (0.1, 0.3), np.random.default_rng(1)) is None


def test_elsewhere_is_another_piece_of_furniture_or_the_one_that_is_asked_for_and_never_a_drawer() -> None:
    end = ScriptedEnd("fetch_cup")
    session: Any = end.session
    truth: Any = end.truth
    end.truth.on["cup"] = ("table",)
    places = RelocationSampler(session, truth)
    surfaces = {
        place.surface
        for seed in range(10)
        if (place := places.elsewhere("cup", None, np.random.default_rng(seed))) is not None
    }
    assert surfaces == {"counter/top"}
    asked = places.elsewhere("cup", "table", np.random.default_rng(0))
    assert asked is not None
    assert asked.surface == "table/top"
    chest = ScriptedEnd("put_away")
    session, truth = chest.session, chest.truth
    chest.truth.on["cup"] = ("table",)
    for seed in range(10):
        place = RelocationSampler(session, truth).elsewhere("cup", None, np.random.default_rng(seed))
        assert place is None or place.surface == "drawer_chest/top"
