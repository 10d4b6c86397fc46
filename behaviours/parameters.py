"""Parameters of the skills: ``skills:`` of a task, ``--set skills.place.set_down_force=3``."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

from bestman_bt.messages.shapes import Count, Fraction, NonNegative, Positive, PositiveFraction


@dataclass(frozen=True)
class ArmMotionParameters:
    """Free motions and straight paths of an arm, for all skills that move one.

    Speeds and accelerations are fractions of the limits of the joints.

    ``free_speed``, ``free_acceleration``: with an empty hand, and on straight paths. ``carrying_speed``,
    ``carrying_acceleration``: on free motions with a held object. ``recovery_speed``, ``recovery_acceleration``: out of
    a start in collision. ``approach_speed``: of straight approaches, as a fraction of the free speed.
    ``retreat_speed``: of straight retreats and of the lift after a grasp, likewise. ``max_held_tilt``: of a held object
    from upright on free motions. ``held_clearance``: of a held object from the robot and all else, where such a path
    exists. ``held_sag``: the same as a fraction of the object's extent from the hand; the larger of both counts.
    ``plans``: largest number of plans while other arms move into the path. ``pull_out``: length of the straight retreat
    with an object grasped from the side. ``posture_tolerance``: of each joint, within which a posture counts as
    reached.
    """

    free_speed: PositiveFraction = 0.5
    free_acceleration: PositiveFraction = 0.35
    carrying_speed: PositiveFraction = 0.4
    carrying_acceleration: PositiveFraction = 0.21
    recovery_speed: PositiveFraction = 0.05
    recovery_acceleration: PositiveFraction = 0.05
    approach_speed: PositiveFraction = 0.1
    retreat_speed: PositiveFraction = 0.5
    max_held_tilt: Annotated[Positive, "rad"] = math.radians(25.0)
    held_clearance: Annotated[NonNegative, "m"] = 0.012
    held_sag: NonNegative = 0.1
    plans: Count = 3
    pull_out: Annotated[NonNegative, "m"] = 0.30
    posture_tolerance: Annotated[NonNegative, "rad"] = 0.02


@dataclass(frozen=True)
class GraspParameters:
    """Grasping, and checks of the held object.

    ``least_force``: closing force if none is given and the weight needs no more. ``torque_safety``: factor of the pads'
    torque over the torque of the object's weight. ``empty_gap``: visible fraction of the gap between the fingers from
    which the hand counts as empty.
    """

    least_force: Annotated[Positive, "N"] = 20.0
    torque_safety: Positive = 4.0
    empty_gap: Fraction = 0.6


@dataclass(frozen=True)
class PlaceParameters:
    """Finding a free place, setting an object down, releasing it.

    ``descent``: height above the goal where the straight descent begins. ``rim_clearance``: the same above the rim of a
    drawer, below the object. ``drop_height``: above the measured surface at which a hand without force sensing releases
    an object. ``hover_height``: from which a hand with force sensing lowers until contact. ``search_depth``: below the
    measured surface at which that ends. ``set_down_speed``: of that motion. ``set_down_force``: contact force that ends
    it: enough to stand, too little to push the object up in the hand. ``tilted_height``: above the goal; an object that
    touches earlier is tilted in the hand. ``loosening_forces``: decreasing grip forces with which a tilted object is
    let down slowly. ``regrip_force``: closing force of fingers that did not release the object, before they open again.
    ``retreat``: length of the straight retreat after releasing, which must be free. ``max_occupied``: largest fraction
    of the disc at the goal that may appear occupied: noise at edges of nearby objects. ``min_free``: smallest fraction
    of the disc at the goal that must be seen free; the rest may be hidden by the carried object.
    """

    descent: Annotated[NonNegative, "m"] = 0.12
    rim_clearance: Annotated[NonNegative, "m"] = 0.03
    drop_height: Annotated[NonNegative, "m"] = 0.002
    hover_height: Annotated[NonNegative, "m"] = 0.008
    search_depth: Annotated[NonNegative, "m"] = 0.01
    set_down_speed: Annotated[Positive, "m/s"] = 0.02
    set_down_force: Annotated[Positive, "N"] = 4.0
    tilted_height: Annotated[NonNegative, "m"] = 0.004
    loosening_forces: Annotated[tuple[Positive, ...], "N"] = (28.0, 20.0, 14.0, 10.0, 7.0, 5.0, 3.5)
    regrip_force: Annotated[Positive, "N"] = 3.0
    retreat: Annotated[NonNegative, "m"] = 0.1
    max_occupied: Fraction = 0.03
    min_free: Fraction = 0.4


@dataclass(frozen=True)
class PushParameters:
    """Pushing an object over its surface.

    ``tip_height``: of the fingertips above the surface: an object that is pushed low slides instead of falling over.
    ``standoff``: between fingertips and object where the straight approach begins. ``palm_clearance``: of all of the
    hand but the fingertips from the object. ``approach_gap``: beyond the scene's padding at which the approach ends:
    the timed motion bends a little. ``finger_spread``: finger opening during the push, as a fraction of the object's
    width. ``edge_margin``: from the mapped edge of the surface that the whole object keeps: the map's error.
    ``goal_tolerance``: within which an object counts as being at its goal.
    """

    tip_height: Annotated[NonNegative, "m"] = 0.03
    standoff: Annotated[Positive, "m"] = 0.06
    palm_clearance: Annotated[NonNegative, "m"] = 0.01
    approach_gap: Annotated[NonNegative, "m"] = 0.003
    finger_spread: Fraction = 0.5
    edge_margin: Annotated[NonNegative, "m"] = 0.03
    goal_tolerance: Annotated[Positive, "m"] = 0.004


@dataclass(frozen=True)
class FurnitureParameters:
    """Moving doors and drawers, for opening and closing.

    ``retreat``: length of the straight retreat from a door or drawer. ``base_clearance``: of the robot's body from
    where the door or drawer passes.
    """

    retreat: Annotated[NonNegative, "m"] = 0.12
    base_clearance: Annotated[NonNegative, "m"] = 0.05


@dataclass(frozen=True)
class OpenParameters:
    """Opening doors and drawers.

    ``drawer_margin``: by which a drawer is pulled beyond the target: the hand yields a little, and the drawer rolls
    back. ``door_margin``: the same for a door. ``max_opening``: largest fraction of a joint's range that is used.
    ``finger_room``: between front and bar from which on fingers around the bar are clear of the front. ``palm_gap``: of
    the palm from a front. ``grasps``: largest number of different grasps to check. ``grip_depth``: fraction of a bar's
    free standoff by which it is gripped deeper than the middle of the pads, since it slips towards the fingertips
    during the motion.
    """

    drawer_margin: Annotated[NonNegative, "m"] = 0.025
    door_margin: Annotated[NonNegative, "rad"] = 0.09
    max_opening: PositiveFraction = 0.95
    finger_room: Annotated[NonNegative, "m"] = 0.03
    palm_gap: Annotated[NonNegative, "m"] = 0.01
    grasps: Count = 6
    grip_depth: Fraction = 0.3


@dataclass(frozen=True)
class CloseParameters:
    """Closing doors and drawers.

    ``standoff``: in front of the door or drawer at which the hand starts to push. ``handle_clearance``: from the pushed
    point to any handle. ``palm_gap``: between palm and front with its handles, in addition to the map's error.
    ``least_lever``: smallest lever of a pushed place, as a fraction of the longest lever. ``places``: number of places
    on the front that are tried with each pitch of the hand. ``finger_force``: with which the fingers are held together.
    ``touch_speed``: of the straight motion to the front. ``touch_force``: at which the front counts as touched: less
    than is needed to move any door or drawer. ``search_distance``: beyond the believed front within which to search for
    it. ``beyond_closed``: beyond the mapped closed position up to which to wait for a resistance.
    ``end_stop_tolerance``: of the fingertips at the end stop, in addition to the furniture's own error.
    """

    standoff: Annotated[NonNegative, "m"] = 0.08
    handle_clearance: Annotated[NonNegative, "m"] = 0.075
    palm_gap: Annotated[NonNegative, "m"] = 0.01
    least_lever: Fraction = 0.5
    places: Count = 6
    finger_force: Annotated[Positive, "N"] = 10.0
    touch_speed: Annotated[Positive, "m/s"] = 0.05
    touch_force: Annotated[Positive, "N"] = 8.0
    search_distance: Annotated[NonNegative, "m"] = 0.08
    beyond_closed: Annotated[NonNegative, "m"] = 0.06
    end_stop_tolerance: Annotated[NonNegative, "m"] = 0.02


@dataclass(frozen=True)
class NavigateParameters:
    """Driving to a pose in spite of obstacles that the map does not contain.

    ``check_period``: between two checks of the path. ``max_detour``: largest detour to take immediately; before a
    longer one, it waits for the obstacle to move away. ``stop_distance``: to an obstacle on the path at which the base
    stops and waits if there is no other path. ``sudden_distance``: an obstacle on the path nearer than this must have
    moved there, perhaps too near for the lidar; the base backs up first. ``wait_for_short``: for a path without a
    longer detour. ``wait_for_any``: for any path. ``back_up``: largest distance of backing up, which also lets waiting
    people pass. ``retry_pause``: before a retry. ``people_factor``: how many failures with a person moving nearby count
    as one of the node's ``max_replans``.
    """

    check_period: Annotated[Positive, "s"] = 0.2
    max_detour: Annotated[NonNegative, "m"] = 1.5
    stop_distance: Annotated[NonNegative, "m"] = 2.0
    sudden_distance: Annotated[NonNegative, "m"] = 1.2
    wait_for_short: Annotated[NonNegative, "s"] = 5.0
    wait_for_any: Annotated[NonNegative, "s"] = 8.0
    back_up: Annotated[NonNegative, "m"] = 0.8
    retry_pause: Annotated[NonNegative, "s"] = 2.0
    people_factor: Count = 3


@dataclass(frozen=True)
class ExploreParameters:
    """Exploring and mapping.

    ``look_period``: between two checks of the unknown space and of the path. ``look_ahead``: of the path that must be
    free. ``clearance``: by which the base's outline is grown: beams clear cells that posts half fill.
    ``goal_tolerance``: from a goal within which it counts as reached if it offers no further view.
    """

    look_period: Annotated[Positive, "s"] = 0.8
    look_ahead: Annotated[NonNegative, "m"] = 1.5
    clearance: Annotated[NonNegative, "m"] = 0.025
    goal_tolerance: Annotated[NonNegative, "m"] = 0.30


@dataclass(frozen=True)
class SkillParameters:
    """The parameters of all skills, by family."""

    arm_motion: ArmMotionParameters = field(default_factory=ArmMotionParameters)
    grasp: GraspParameters = field(default_factory=GraspParameters)
    place: PlaceParameters = field(default_factory=PlaceParameters)
    push: PushParameters = field(default_factory=PushParameters)
    furniture: FurnitureParameters = field(default_factory=FurnitureParameters)
    open: OpenParameters = field(default_factory=OpenParameters)
    close: CloseParameters = field(default_factory=CloseParameters)
    navigate: NavigateParameters = field(default_factory=NavigateParameters)
    explore: ExploreParameters = field(default_factory=ExploreParameters)
