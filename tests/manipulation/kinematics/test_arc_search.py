"""Paths through stations and the ranking of stands, on two slides whose paths can be worked out by hand."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from bestman_bt.manipulation.base_placement import BasePlacements, PathPlacements, ReachingArm
from bestman_bt.manipulation.kinematics.arc_path import ArcSearch
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.world_model.semantic_map import MapFurniture
from tests.manipulation.kinematics.slides import LIMITS, Slides, at

SLIDES = Slides()
STIFF = ArcSearch(centring=0.0)


def line(*places: float):
    return [[at(x)] for x in places]


@pytest.mark.parametrize(("step", "reached"), [(0.79, 3), (0.81, 2)])
def test_no_joint_moves_farther_than_its_step_from_station_to_station(step, reached):
    """Half of each step falls on each slide, which may move by 0.4."""
    arc = STIFF.path(SLIDES, line(0.0, 0.1, 0.1 + step), np.zeros(2), LIMITS)
    assert len(arc.path) == reached
    assert arc.complete is (reached == 3)


def test_the_margin_is_the_room_of_the_worst_joint_anywhere_on_the_way():
    arc = STIFF.path(SLIDES, line(0.0, -0.6, 0.0), np.array([0.1, -0.1]), LIMITS)
    assert arc.path[1] == pytest.approx([-0.2, -0.4])
    assert arc.margin == pytest.approx(0.6)
    up = STIFF.path(SLIDES, line(0.0, 0.6, 0.0), np.array([0.1, -0.1]), LIMITS)
    assert up.margin == pytest.approx(0.6)
    at_the_limit = STIFF.path(SLIDES, line(0.0), np.array([1.0, -1.0]), LIMITS)
    assert at_the_limit.margin == 0.0


def test_redundancy_brings_joints_from_their_limits_and_none_nearer_to_its_own():
    arc = ArcSearch().path(SLIDES, line(*[0.3] * 12), np.array([0.9, -0.6]), LIMITS)
    assert np.all(np.diff(np.abs(arc.path).max(axis=1)) < 0.0)
    assert arc.path.sum(axis=1) == pytest.approx(0.3)
    strong = ArcSearch(centring=1.0)
    crowded = strong.path(SLIDES, line(1.974), np.array([0.975, 0.999]), LIMITS)
    assert crowded.path[0] == pytest.approx([0.995, 0.979], abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_of_all_ways_through_the_options_the_cheapest_is_taken(seed):
    """Against all sequences in which the hand turns by at most one place: squared motion and strain at the limits."""
    rng = np.random.default_rng(seed)
    stations = [[at(x) for x in rng.uniform(-1.4, 1.4, 3)] for _ in range(5)]
    start, wide = np.array([0.2, -0.2]), ArcSearch(centring=0.0, max_step=5.0)

    def cost(options):
        total, before = 0.0, start
        for station, option in zip(stations, options, strict=True):
            q = SLIDES.track(station[option], before)
            total += float((q - before) @ (q - before)) + 0.1 * np.abs(q).max() ** 4
            before = q
        return total

    ways = [w for w in product(range(3), repeat=5) if np.abs(np.diff(w)).max() <= 1]
    assert wide.path(SLIDES, stations, start, LIMITS).options == min(ways, key=cost)


@pytest.mark.parametrize("middle", [0, 2, 4])
def test_a_path_through_a_middle_station_asks_and_answers_in_the_order_of_the_stations(middle):
    """Each station has one free pose of three: the hand turns back and forth."""
    free, places = (1, 0, 1, 2, 1), (0.0, 0.2, 0.5, 0.6, 0.9)
    stations = [[at(x + 0.01 * option) for option in range(3)] for x in places]
    wanted = [x + 0.01 * option for x, option in zip(places, free, strict=True)]

    def is_free(q, station):
        return abs(float(q.sum()) - wanted[station]) < 1e-6

    root = np.full(2, wanted[middle] / 2)
    arc = STIFF.path_through(SLIDES, stations, middle, free[middle], root, LIMITS, is_free)
    assert arc.complete
    assert arc.options == free
    assert arc.path.sum(axis=1) == pytest.approx(wanted)
    assert arc.margin == pytest.approx(1.0 - wanted[-1] / 2)
    turned = STIFF.path_through(SLIDES, stations[::-1], 4 - middle, free[middle], root, LIMITS, None)
    assert turned.margin == pytest.approx(1.0 - turned.path.max(), abs=1e-9)


def test_a_path_that_ends_early_on_one_side_says_on_which():
    stations = line(0.0, 0.2, 0.4, 0.6)
    root = np.full(2, 0.1)
    ahead = STIFF.path_through(SLIDES, stations, 1, 0, root, LIMITS, lambda q, station: station < 3)
    assert (len(ahead.path), ahead.failure[:24]) == (3, "onwards from station 1: ")
    back = STIFF.path_through(SLIDES, stations, 1, 0, root, LIMITS, lambda q, station: station > 0)
    assert (len(back.path), back.failure[:26]) == (0, "backwards from station 1: ")


MARKS = line(0.2, 0.4, 0.6)
HOME = np.zeros(2)


def along(candidates, stations=MARKS, search=None, **options):
    rng = np.random.default_rng(0)
    return (search or PathPlacements()).rank(
        candidates, stations, ReachingArm(SLIDES, LIMITS, HOME, rng), arc=STIFF, **options
    )


def test_stands_where_the_base_may_not_be_do_not_count_as_tried():
    stands = [Pose2D(-0.1 * i, 0.0) for i in range(4)]
    found = along(stands, is_base_free=lambda stand: stand is stands[3], search=PathPlacements(most=1))
    assert [stand.pose for stand in found] == [stands[3]]


def test_a_partial_path_does_not_end_the_search_and_comes_after_a_complete_one():
    """From a metre back the last station is refused; that stand promises most and has more room."""
    partial, whole = Pose2D(-0.5, 0.0), Pose2D(0.2, 0.0)
    half = PathPlacements(enough=1, min_fraction=0.5)

    def is_free_at(stand):
        return lambda q, station: stand is whole or station < 2

    found = along([partial, whole], is_free_at=is_free_at, search=half)
    assert [stand.pose for stand in found] == [whole, partial]
    assert [stand.arc.complete for stand in found] == [True, False]
    assert [stand.pose for stand in along([partial, whole], is_free_at=is_free_at)] == [whole]


def test_of_equal_stands_the_one_that_takes_less_driving_is_better_whichever_way_round_the_turn_goes():
    """Right below the target, where the heading makes no difference but for the driving."""
    current = Pose2D(-3.1, 0.0, 3.0)
    near, far = Pose2D(0.8, 0.0, -3.1), Pose2D(0.8, 0.0, 2.6)
    stations = line(0.8)
    for stands in ([near, far], [far, near]):
        ranked = along(stands, stations, current=current)
        assert [stand.pose for stand in ranked] == [near, far]
        assert PathPlacements().promising(stands, stations, SLIDES, Even(), current) == (near, far)
    first, second = along([Pose2D(0.0, 0.0), Pose2D(0.0, 1.0)], current=Pose2D(0.0, 0.2))
    assert (first.pose.y, second.pose.y) == (0.0, 1.0)
    assert first.score - second.score == pytest.approx(0.05 * 0.6)


class Even:
    """A reachability map on which every pose is as good."""

    def score(self, positions, approaches):
        return np.full(len(positions), 0.5)


class Table(Even):
    """Scores by the x of a position in the base frame, and by how far the approach points to -x there."""

    def __init__(self, scores: dict[float, float]) -> None:
        self.scores = scores

    def score(self, positions, approaches):
        return np.array([self.scores.get(round(float(x), 3), 0.0) for x, _, _ in positions])


def test_a_stand_promises_what_the_worst_station_on_its_best_way_does():
    """The hand may turn by one place from station to station: ways that jump over one do not count."""
    stations = [[at(0.1), at(0.2), at(0.3)], [at(0.4), at(0.5), at(0.6)]]
    jump = Table({0.1: 0.9, 0.6: 0.9, 0.2: 0.2, 0.5: 0.2, 0.3: 0.1, 0.4: 0.1})
    step = Table({0.2: 0.3, 0.6: 0.9, 0.1: 0.1, 0.3: 0.1, 0.4: 0.1, 0.5: 0.1})
    back = Table({0.3: 0.9, 0.5: 0.3, 0.1: 0.1, 0.2: 0.1, 0.4: 0.1, 0.6: 0.1})
    for table, promise in ((jump, 0.2), (step, 0.3), (back, 0.3)):
        here = Pose2D()
        costs = PathPlacements(travel_cost=1.0)
        for rival, order in ((promise - 0.01, 1), (promise + 0.01, -1)):
            # The rival's own promise is known: all its stations score alike.
            shifted = Table(
                {**table.scores, **{round(p.position[0] + 0.8, 3): rival + 0.8 for s in stations for p in s}}
            )
            found = costs.promising([here, Pose2D(-0.8, 0.0)], stations, SLIDES, shifted, here)
            assert found == (here, Pose2D(-0.8, 0.0))[::order]


def test_stations_of_other_numbers_of_places_are_entered_from_anywhere():
    stations = [[at(0.1), at(0.2)], [at(0.4)], [at(0.5), at(0.6)]]
    good = Table({0.1: 0.1, 0.2: 0.9, 0.4: 0.8, 0.5: 0.7, 0.6: 0.1, 1.1: 0.6, 1.2: 0.6, 1.4: 0.6, 1.5: 0.6, 1.6: 0.6})
    assert PathPlacements().promising([Pose2D(-1.0, 0.0), Pose2D()], stations, SLIDES, good)[0] == Pose2D()


class Downwind(Even):
    """Likes tools whose z axis points to the base frame's +y."""

    def score(self, positions, approaches):
        return 0.5 + 0.5 * np.asarray(approaches)[:, 1]


def test_approaches_are_looked_at_in_the_frame_of_the_base():
    """The tool's z axis points to the map's +x: to +y of a base that is turned to the right."""
    forward = Pose.from_xyz_rpy((0.1, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    opposite = Pose.from_xyz_rpy((0.1, 0.0, 0.0), (0.0, -np.pi / 2, 0.0))
    right, left = Pose2D(0.0, 0.0, -np.pi / 2), Pose2D(0.0, 0.0, np.pi / 2)
    assert PathPlacements().promising([left, right], [[forward]], SLIDES, Downwind())[0] == right
    ranked = BasePlacements(enough=1).rank(
        [left, right], [[opposite, forward]], ReachingArm(SLIDES, LIMITS, HOME, np.random.default_rng(0), Downwind())
    )
    assert [stand.pose for stand in ranked] == [right]


def test_stands_out_of_reach_of_a_station_promise_nothing():
    assert PathPlacements().promising([Pose2D(), Pose2D(-1.5, 0.0)], MARKS, SLIDES, Even()) == (Pose2D(),)
    assert along([Pose2D(-1.5, 0.0)]) == ()


def rank(candidates, alternatives, search=None, **options):
    search, rng = search or BasePlacements(), np.random.default_rng(0)
    return search.rank(candidates, alternatives, ReachingArm(SLIDES, LIMITS, HOME, rng), **options)


def test_an_alternative_is_as_comfortable_as_its_least_comfortable_pose():
    """The second alternative begins better than the first and ends worse."""
    near, mixed = [at(0.8), at(0.8)], [at(0.0), at(1.6)]
    (stand,) = rank([Pose2D()], [mixed, near])
    assert stand.alternative == 1
    assert stand.reachable == 2
    assert stand.positions == pytest.approx([0.4, 0.4])
    assert stand.score == pytest.approx(1.0 + 0.5 * 0.6)


def test_an_alternative_counts_only_when_all_of_its_poses_are_reached():
    (stand,) = rank([Pose2D()], [[at(0.2), at(2.4)], [at(0.4)]])
    assert (stand.reachable, stand.alternative) == (1, 1)
    assert rank([Pose2D()], [[at(0.2), at(2.4)]]) == ()


def test_each_pose_is_sought_from_the_solution_before():
    """From home the second pose would be out of what is free."""
    world = type("World", (), {"is_free": lambda self, q: q[0] - q[1] > -0.1})()
    seeds = []

    class Noting(Slides):
        def solve(self, base_from_tool, reference, *args, **options):
            seeds.append(np.array(reference))
            return super().solve(base_from_tool, reference, *args, **options)

    BasePlacements().rank(
        [Pose2D()],
        [[at(0.2), at(0.6)]],
        ReachingArm(Noting(), LIMITS, HOME, np.random.default_rng(0)),
        world_at=lambda stand: world,
    )
    assert [seed.tolist() for seed in seeds] == [[0.0, 0.0], [0.1, 0.1]]


def test_the_last_pose_of_an_alternative_reports_which_stand_is_tried_first():
    """The grasp at 1.24 m, 0.62 of the reach, is best; the pre-grasp alone would prefer the other stand."""
    poses = [at(0.24), at(1.24)]
    ranked = rank([Pose2D(-1.0, 0.0), Pose2D()], [poses], search=BasePlacements(enough=1))
    assert [stand.pose for stand in ranked] == [Pose2D()]


def test_a_turn_the_short_way_costs_the_stand_little():
    current = Pose2D(0.0, 0.0, 3.0)
    near, far = Pose2D(0.8, 0.0, -3.1), Pose2D(0.8, 0.0, 2.0)
    first, second = rank([far, near], [[at(0.8)]], current=current)
    assert (first.pose, second.pose) == (near, far)


def test_stands_keep_beside_furniture_that_is_narrower_than_their_offsets():
    table = MapFurniture("table", Pose2D(), (0.4, 1.0), 0.7, (), False)
    search = BasePlacements(gaps=(0.1,), offsets=(0.0, 0.3))
    left = search.beside(table, (0.1, 0.0), 0.3, ("left",))
    assert [(stand.x, stand.y) for stand in left] == [pytest.approx((0.1, 0.9)), pytest.approx((0.2, 0.9))]
    front = search.beside(table, (0.0, 0.4), 0.3, ("front",))
    assert [(stand.x, stand.y) for stand in front] == [pytest.approx((-0.6, 0.4)), pytest.approx((-0.6, 0.5))]
