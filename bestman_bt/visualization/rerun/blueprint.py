"""The layout of an opened recording: scene and camera on the left, tree and its log on the right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.records.nodes import NodeList
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.tree_graph import TreeGraph, lane_entities

if TYPE_CHECKING:
    import rerun.blueprint as rrb

BACKGROUND = (28, 31, 38)
GRAPH_MARGIN = 20.0


@dataclass(frozen=True)
class Eye:
    """The viewpoint of the scene in the map frame, metres."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]


def eye_on(bounds: NDArray[np.float64], azimuth: float = -2.2, elevation: float = 0.8) -> Eye:
    """Return a view from outside and above of the middle of a (2, 3) bounding box, metres; angles from the middle to
    the eye, radians.
    """
    centre, extent = bounds.mean(axis=0), bounds[1] - bounds[0]
    look_at = np.array([centre[0], centre[1], min(0.5, bounds[1][2] / 2)])
    distance = max(2.5, 0.66 * float(np.linalg.norm(extent[:2])))
    direction = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    position = look_at + distance * direction
    return Eye(tuple(position.tolist()), tuple(look_at.tolist()))


def build_blueprint(tree: NodeList, eye: Eye, cameras: Sequence[str], plots: Sequence[str]) -> rrb.Blueprint:
    """Return the viewer layout for a run with these cameras and plotted entities."""
    import rerun.blueprint as rrb

    below_scene = [*_camera_views(cameras), *_plots(plots)]
    scene = _scene_view(eye, cameras)
    left = rrb.Vertical(scene, rrb.Horizontal(*below_scene), row_shares=[3, 2]) if below_scene else scene
    right = rrb.Vertical(
        _graph_view(tree),
        rrb.Horizontal(_lanes_view(tree), rrb.Tabs(*_log_views(), active_tab=0), column_shares=[1, 1]),
        row_shares=[3, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[1, 1]),
        rrb.TimePanel(state="collapsed", timeline=entities.SIM_TIME),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _scene_view(eye: Eye, cameras: Sequence[str]) -> rrb.Spatial3DView:
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=entities.WORLD,
        name="scene",
        contents=["$origin/**", *(f"- /{entities.camera_entity(camera)}/depth" for camera in cameras)],
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=1.0, color=(255, 255, 255, 25)),
        spatial_information=rrb.SpatialInformation(target_frame=entities.MAP_FRAME),
        eye_controls=rrb.EyeControls3D(position=eye.position, look_target=eye.look_at, eye_up=[0, 0, 1]),
    )


def _camera_views(cameras: Sequence[str]) -> list[rrb.Tabs]:
    import rerun.blueprint as rrb

    return [
        rrb.Tabs(
            *(
                rrb.Spatial2DView(
                    origin=entities.camera_entity(camera),
                    contents=[f"$origin/{part}"],
                    name=f"{camera} {word}",
                    background=BACKGROUND,
                )
                for part, word in (("rgb", "colour"), ("depth", "depth"))
            ),
            active_tab=0,
        )
        for camera in cameras
    ]


def _plots(plots: Sequence[str]) -> list[rrb.Tabs]:
    import rerun.blueprint as rrb

    views = [rrb.TimeSeriesView(origin=plot, name=plot) for plot in plots]
    return [rrb.Tabs(*views, active_tab=0)] if views else []


def _graph_view(tree: NodeList) -> rrb.GraphView:
    import rerun.blueprint as rrb

    width, height = TreeGraph.layout(tree).size
    return rrb.GraphView(
        origin=entities.TREE_GRAPH,
        name="tree",
        background=rrb.archetypes.GraphBackground(color=BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-GRAPH_MARGIN, width + GRAPH_MARGIN], y_range=[-GRAPH_MARGIN, height + GRAPH_MARGIN]
        ),
    )


def _lanes_view(tree: NodeList) -> rrb.StateTimelineView:
    import rerun.blueprint as rrb

    lanes = lane_entities(tree)
    return rrb.StateTimelineView(
        origin=entities.NODES,
        name="what the leaves did",
        contents=[f"/{lanes[leaf.uid]}" for leaf in tree.leaves()],
    )


def _log_views() -> list[rrb.TextLogView]:
    import rerun.blueprint as rrb

    columns = [
        rrb.encodings.TextLogColumn(rrb.encodings.TextLogColumnKind.LogLevel),
        rrb.encodings.TextLogColumn(rrb.encodings.TextLogColumnKind.Body),
    ]
    return [
        rrb.TextLogView(
            origin=origin,
            name=origin,
            columns=rrb.TextLogColumns(
                timeline_columns=[rrb.encodings.TimelineColumn(entities.SIM_TIME, visible=True)],
                text_log_columns=columns[skipped:],
            ),
        )
        for origin, skipped in ((entities.LOG, 0), (entities.BLACKBOARD, 1))
    ]
