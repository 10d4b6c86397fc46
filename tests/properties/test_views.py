"""What holds for each algorithm that looks at views: in any frame, in any order, and where pixels know nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.rendering import render_view
from bestman_bt.messages import VOXEL_OCCUPIED, Box, CameraIntrinsics, Handle, PlacedShape, Pose, RGBDImage, YawSet
from bestman_bt.perception.affordance.front_handles import FrontHandles
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.errors import NoSurfaceError, PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.perception.grasp_pose.handle_grasp import HandleGrasp
from bestman_bt.perception.grasp_pose.model_based import ModelBased
from bestman_bt.perception.occupancy import LogOdds, VoxelRegion
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.pose_estimation.multi_view import MultiView, ViewObservation
from bestman_bt.perception.segmentation.base import Region
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.segmentation.support_surfaces import SupportSurfaces
from bestman_bt.perception.tracking import GlobalNearestNeighbour
from bestman_bt.perception.view import View
from bestman_bt.perception.view_planning import ExpectedYaw
from bestman_bt.scene.furniture_generator.generate import generate_furniture
from tests.perception.affordance.conftest import camera_before, shapes_of
from tests.perception.grasp_pose.test_antipodal_cloud import GRIPPER
from tests.perception.grasp_pose.test_handle_grasp import handle
from tests.perception.pose_estimation.seen_objects import MAST, TABLE, cluster_of, photographed, shipped, standing
from tests.perception.seen_boxes import looking_at, view_of
from tests.perception.tracking.test_global_nearest_neighbour import BOX, CAN, sighted
from tests.properties.profile import examples

pytestmark = pytest.mark.slow

K = CameraIntrinsics(320, 240, 216.0, 216.0, 159.5, 119.5)
worlds = st.builds(
    lambda x, y, z, yaw: Pose.from_xyz_rpy((x, y, z), (0.0, 0.0, yaw)),
    *(st.floats(-30, 30), st.floats(-30, 30), st.sampled_from([0.0, 0.0, 0.4]), st.floats(-3, 3)),
)
level_worlds = worlds.map(lambda world: Pose(world.position * (1.0, 1.0, 0.0), world.quaternion))
seeds = st.integers(0, 10_000)
NOTHING = st.sampled_from([0.0, math.nan, math.inf, -1.0])
BOARD = PlacedShape(Box((0.8, 1.2, 0.04)), Pose(np.array([0.8, 0.0, 0.73])))
FLOOR = PlacedShape(Box((8.0, 8.0, 0.02)), Pose(np.array([0.0, 0.0, -0.01])))
EYE = looking_at((-0.2, 0.1, 1.5), (0.8, 0.0, 0.75))
AROUND = Region(Pose(np.array([0.8, 0.0, 0.75])), (0.84, 1.24))


def things(seed):
    """A table with up to four boxes that stand apart."""
    rng = np.random.default_rng(seed)
    solids = []
    for x, y in rng.permutation([(0.6, -0.35), (0.6, 0.3), (1.0, -0.2), (1.0, 0.4)])[: rng.integers(5)]:
        size = rng.uniform(0.05, 0.15, 3)
        pose = Pose.from_xyz_rpy((x, y, 0.75 + size[2] / 2), (0.0, 0.0, rng.uniform(-3, 3)))
        solids.append(PlacedShape(Box(tuple(size.tolist())), pose))
    return solids


def seen(solids, seed=0, eye=EYE):
    return view_of([BOARD, FLOOR, *solids], eye, 1.0, np.random.default_rng(seed))


def with_depth(view, depth):
    image = view.image
    return View(RGBDImage(image.rgb, depth, image.intrinsics, image.stamp), view.frame_from_camera)


def speckled(view, value, share, seed):
    """The view, but for a share of pixels whose depth is ``value``."""
    lost = np.random.default_rng(seed).random(view.image.depth.shape) < share
    return with_depth(view, np.where(lost, np.float32(value), view.image.depth))


def close(one, other, metres=1e-4, radians=1e-3):
    apart = one.inverse() @ other
    return bool(np.linalg.norm(apart.position) < metres and 2 * math.acos(min(1.0, abs(apart.quaternion[3]))) < radians)


@pytest.mark.parametrize("segmentation", [PlaneDbscan(), RegionGrowing()])
@examples(8)
@given(seeds, worlds, st.floats(0.0, 0.15), NOTHING)
def test_the_same_things_are_segmented_in_any_frame_and_with_any_mark_of_unknown_depth(
    segmentation, seed, world, share, value
):
    solids = things(seed)
    view = seen(solids, seed)
    first, second = (
        segmentation.segment(speckled(one, mark, share, seed), region, np.random.default_rng(0))
        for one, mark, region in (
            (view, 0.0, AROUND),
            (view.seen_from(world), value, replace(AROUND, frame_from_surface=world @ AROUND.frame_from_surface)),
        )
    )
    assert len(first.clusters) == len(second.clusters) == len(solids)
    assert second.planes[0].height_at(*(world.apply(np.array([0.8, 0.0, 0.0])))[:2]) == pytest.approx(
        0.75 + world.position[2], abs=0.004
    )
    for one in first.clusters:
        middle = world.apply(one.points.mean(axis=0))
        assert min(np.linalg.norm(other.points.mean(axis=0) - middle) for other in second.clusters) < 0.005


@pytest.mark.parametrize("find", [PlaneDbscan(), RegionGrowing(), SupportSurfaces()])
@examples(6)
@given(NOTHING, st.sampled_from([0.0, 1e-5, 1e-4]), seeds)
def test_a_view_of_next_to_nothing_shows_no_surface(find, value, share, seed):
    depth = np.full((240, 320), value, dtype=np.float32)
    depth[np.random.default_rng(seed).random(depth.shape) < share] = 1.3
    view = with_depth(seen([]), depth)
    rng = np.random.default_rng(0)
    with pytest.raises(NoSurfaceError):
        find.find(view, rng) if isinstance(find, SupportSurfaces) else find.segment(view, AROUND, rng)


@examples(8)
@given(seeds, level_worlds, NOTHING)
def test_surfaces_are_found_at_the_same_places_in_any_frame(seed, world, value):
    view = speckled(seen(things(seed), seed), value, 0.05, seed)
    here = SupportSurfaces().find(view, np.random.default_rng(0))
    there = SupportSurfaces().find(view.seen_from(world), np.random.default_rng(0))
    assert len(here) == len(there) >= 1
    for one, other in zip(here, there, strict=True):
        moved = world.apply(one.frame_from_plane.position)
        np.testing.assert_allclose(moved, other.frame_from_plane.position, atol=0.01)
        np.testing.assert_allclose(one.size, other.size, atol=0.01)
    assert min(abs(plane.frame_from_plane.position[2] - 0.75) for plane in here) < 0.004


@examples(2)
@given(st.sampled_from(["mug", "can", "box", "bowl"]), st.floats(-3, 3), worlds, seeds)
def test_a_pose_is_estimated_alike_in_any_frame_and_in_any_order_of_points_models_and_views(name, yaw, world, seed):
    item = standing(shipped(name), -0.1, 0.0, yaw)
    models = [shipped(name), shipped("duck")]
    beside = looking_at(item.pose.position + np.array([0.25, 0.3, 0.35]), item.pose.position)
    views = [photographed([item], MAST), photographed([item], beside, seed=1)]
    observed = [ViewObservation(cluster_of(view, item), view) for view in views]
    rng = np.random.default_rng(seed)
    moved = [ViewObservation(one.cluster.seen_from(world), one.view.seen_from(world)) for one in observed]
    single = [
        MultiStart().estimate(one.cluster, some, one.view)
        for one, some in ((observed[0], models), (moved[0], models), (observed[0], models[::-1]))
    ]
    order = rng.permutation(len(observed[0].cluster.points))
    cluster = observed[0].cluster
    mixed = replace(cluster, points=cluster.points[order], colors=cluster.colors[order])
    single.append(MultiStart().estimate(mixed, models, views[0]))
    several = [MultiView().estimate(some, models) for some in (observed, moved, observed[::-1])]
    for found, atol in ((single, 0.004), (several, 0.004)):
        names = [[one.model.name for one in hypotheses][:1] for hypotheses in found]
        assert names == [[name]] * len(found)
        here = found[0][0]
        np.testing.assert_allclose(here.pose.position, item.pose.position, atol=0.008)
        for index, hypotheses in enumerate(found[1:], start=1):
            back = world.inverse().apply(hypotheses[0].pose.position) if index == 1 else hypotheses[0].pose.position
            np.testing.assert_allclose(back, here.pose.position, atol=atol)
            assert hypotheses[0].confidence == pytest.approx(here.confidence, abs=0.1)


@examples(2)
@given(st.lists(st.sampled_from(["mug", "can", "box", "bowl"]), min_size=1, max_size=3, unique=True), worlds, NOTHING)
def test_known_objects_are_detected_alike_in_any_frame_and_any_order_of_the_models(names, world, value):
    items = [standing(shipped(name), -0.15, 0.35 * (index - 1), 0.7) for index, name in enumerate(names)]
    view = speckled(photographed(items), value, 0.02, 1)
    models = [shipped(name) for name in ("mug", "can", "box", "bowl", "duck")]
    region = Region(TABLE, (0.9, 1.3))
    here, there, mixed = (
        ColorShape().detect(one, at, some, np.random.default_rng(0))
        for one, at, some in (
            (view, region, models),
            (view.seen_from(world), replace(region, frame_from_surface=world @ TABLE), models),
            (view, region, models[::-1]),
        )
    )
    for scene, frame in ((here, Pose()), (there, world), (mixed, Pose())):
        assert sorted(found.name for found in scene.detections) == sorted(names)
        for name, item in zip(names, items, strict=True):
            at = scene.find(name).pose.position
            # The handle of the mug may be hidden: its place is then open to 1.5 cm.
            np.testing.assert_allclose(at, frame.apply(item.pose.position), atol=0.02)


@examples(3)
@given(st.sampled_from(["drawer_chest", "cupboard"]), st.integers(1, 4), worlds, st.floats(15, 35))
def test_handles_are_found_at_the_same_places_in_any_frame(kind, seed, world, aside):
    rng = np.random.default_rng(seed)
    model = generate_furniture(kind, rng)
    true = [articulation.handle for articulation in model.articulations]
    eye = camera_before(np.mean([one.pose.position for one in true], axis=0), 1.2, aside, 15.0)
    view = render_view(shapes_of(model), eye, rng)
    here = FrontHandles().detect(view, np.random.default_rng(0)).handles
    there = FrontHandles().detect(view.seen_from(world), np.random.default_rng(0)).handles
    assert len(here) == len(there) == len(true)
    for one in here:
        at = world.apply(one.pose.position)
        other = min(there, key=lambda handle: float(np.linalg.norm(handle.pose.position - at)))
        np.testing.assert_allclose(other.pose.position, at, atol=0.01)
        assert other.kind == one.kind
        np.testing.assert_allclose(world.rotation @ one.opening_direction, other.opening_direction, atol=0.1)


@examples(6)
@given(NOTHING)
def test_a_view_without_depth_has_no_handles(value):
    view = with_depth(seen([]), np.full((240, 320), value, dtype=np.float32))
    with pytest.raises(PerceptionError):
        FrontHandles().detect(view, np.random.default_rng(0))


@examples(6)
@given(st.sampled_from(["bar", "knob", "edge"]), worlds, st.floats(0.003, 0.03), st.floats(0.03, 0.3))
def test_a_handle_is_grasped_alike_in_any_frame(kind, world, radius, length):
    here: Handle = handle(kind, radius=radius, length=length)
    there = replace(here, pose=world @ here.pose, opening_direction=world.rotation @ here.opening_direction)
    plans = [
        HandleGrasp().plan(GraspTarget(PlacedShape(Box((0.2, 0.05, 0.05)), one.pose), handle=one), GRIPPER, floor)
        for one, floor in ((here, 0.0), (there, float(world.position[2])))
    ]
    assert len(plans[0]) == len(plans[1])
    for one, other in zip(*plans, strict=True):
        assert one.quality == pytest.approx(other.quality, abs=1e-6)
    for one in plans[0]:
        assert any(close(world @ one.grasp, other.grasp) for other in plans[1])


@examples(12)
@given(st.sampled_from(["mug", "can", "box", "bowl", "duck"]), worlds, st.floats(-3, 3))
def test_a_known_object_is_grasped_alike_in_any_frame(name, world, yaw):
    pose = standing(shipped(name), 0.0, 0.0, yaw).pose
    plans = [
        ModelBased().plan(GraspTarget.of_model(shipped(name), frame @ pose), GRIPPER, 0.75 + float(frame.position[2]))
        for frame in (Pose(), world)
    ]
    assert len(plans[0]) == len(plans[1])
    assert [one.quality for one in plans[0]] == pytest.approx([one.quality for one in plans[1]], abs=0.02)


@examples(6)
@given(seeds, worlds, NOTHING, st.permutations(range(3)))
def test_voxels_are_the_same_in_any_frame_any_order_of_views_and_with_any_mark_of_unknown_depth(
    seed, world, value, order
):
    eyes = [looking_at(eye, (0.8, 0.0, 0.75)) for eye in ((-0.2, 0.1, 1.5), (0.3, 1.1, 1.6), (0.4, -1.2, 1.5))]
    views = [speckled(seen(things(seed), seed, eye), 0.0, 0.1, seed) for eye in eyes]
    marked = [with_depth(v, np.where(v.image.depth > 0, v.image.depth, np.float32(value))) for v in views]
    region = VoxelRegion(Pose(np.array([0.8, 0.0, 0.8])), (0.9, 1.3, 0.5))
    there = replace(region, frame_from_region=world @ region.frame_from_region)
    one = LogOdds().fuse(views, region)
    other = LogOdds().fuse([view.seen_from(world) for view in marked], there)
    assert (one.states != other.states).mean() < 0.002
    mixed = LogOdds().fuse([views[i] for i in order], region)
    assert (one.states != mixed.states).mean() < 0.02
    hidden = LogOdds().fuse([with_depth(views[0], np.full((240, 320), value, dtype=np.float32))], region)
    assert not (hidden.states == VOXEL_OCCUPIED).any()


@examples(10)
@given(seeds, worlds, st.randoms())
def test_identities_do_not_depend_on_the_frame_or_the_order_of_sightings_and_beliefs(seed, world, random):
    rng = np.random.default_rng(seed)
    places = rng.permutation([(0.6, -0.35), (0.6, 0.3), (1.0, -0.2), (1.0, 0.4), (0.8, 0.05)])
    view = seen([])
    tracker = GlobalNearestNeighbour()
    models = [CAN, CAN, BOX, BOX, CAN]
    before = tracker.update(
        {}, [sighted(model, *place) for model, place in zip(models, places, strict=True)], view
    ).objects
    shift = rng.uniform(-0.08, 0.08, (5, 2))
    kept = int(rng.integers(1, 6))
    now = [sighted(model, *(p + s)) for model, p, s in zip(models[:kept], places, shift, strict=False)]

    def names(sightings, beliefs, frame):
        moved = {n: replace(b, pose=frame @ b.pose) for n, b in beliefs.items()}
        seen_now = [replace(s, pose=frame @ s.pose) for s in sightings]
        tracked = tracker.update(moved, seen_now, view.seen_from(frame))
        return dict(zip([tuple(np.round(s.pose.position, 6)) for s in sightings], tracked.identities, strict=True)), {
            (change.kind, change.name) for change in tracked.changes
        }

    plain = names(now, before, Pose())
    assert names(now, before, world) == plain
    assert names(random.sample(now, len(now)), before, Pose()) == plain
    assert names(now, dict(random.sample(list(before.items()), len(before))), Pose()) == plain


@examples(5)
@given(st.floats(-3, 3), st.floats(0.2, 1.5), worlds, st.randoms())
def test_views_are_ranked_alike_in_any_frame_and_in_any_order(yaw, half, world, random):
    def believed(frame):
        turn = frame.yaw
        pose = frame @ Pose.from_xyz_rpy((0.6, 0.1, 0.8), (0.0, 0.0, yaw))
        arcs = YawSet(((yaw + turn, half),))
        return PoseHypothesis(shipped("mug"), pose, 0.9, np.eye(6) * 1e-6, arcs, 0.001, 1.0, 0.9, 0.0, 0.0)

    planner = ExpectedYaw()
    candidates = planner.candidates(believed(Pose()), K)[::7]
    here = {view.index: view for view in planner.rank(believed(Pose()), candidates, K)}
    there = planner.rank(believed(world), [world @ candidate for candidate in candidates], K)
    order = random.sample(range(len(candidates)), len(candidates))
    mixed = planner.rank(believed(Pose()), [candidates[i] for i in order], K)
    for view in there:
        assert view.expected_yaw_width == pytest.approx(here[view.index].expected_yaw_width, abs=0.1)
    for view in mixed:
        assert view.expected_yaw_width == pytest.approx(here[order[view.index]].expected_yaw_width, abs=1e-6)
        assert view.visible_fraction == pytest.approx(here[order[view.index]].visible_fraction, abs=1e-6)
