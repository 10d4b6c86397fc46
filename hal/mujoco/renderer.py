"""MuJoCo's renderer without a window, for the robot's cameras and for pictures for people."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, PlacedShape, Pose
from hal.mujoco.package import mujoco
from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.world_builder import SEEN, SOLID_AND_SEEN, Shapes
from hal.simulation.bodies import SimulationError, Viewpoint
from hal.simulation.camera import smooth

NO_RENDERER = (
    "MuJoCo finds no OpenGL to draw without a window ({error}). On Debian this helps: "
    "sudo apt-get install -y libegl1 libgl1-mesa-dri; or, without EGL, libosmesa6 and MUJOCO_GL=osmesa"
)

FAR = 30.0
"""Far clipping distance of pictures, metres."""


def _graphics(width: int, height: int) -> Any:
    """Return the graphics backends: those of MUJOCO_GL, else EGL on Linux: MuJoCo's own choice is a window system,
    which needs a display.
    """
    if os.environ.get("MUJOCO_GL") or sys.platform != "linux":
        return mujoco.GLContext(width, height)
    return import_module("mujoco.egl").GLContext(width, height)


class Renderer:
    """Renders one simulation; the graphics context is created for the first image."""

    def __init__(self, model: Any, data: Any) -> None:
        self._model, self._data = model, data
        self._gl: Any = None
        self._size = (0, 0)
        self._scene: Any = None
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[[SOLID_AND_SEEN, SEEN]] = 1

    def close(self) -> None:
        """Free the graphics context; idempotent."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def pinhole(
        self, map_from_optical: Pose, k: CameraIntrinsics, near: float, far: float, segments: bool = False
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        """Render colour (H, W, 3), or ``segments`` instead, and depth (H, W), metres, ``far`` without a hit.

        MuJoCo renders square pixels: if those of ``k`` are not square, more or fewer columns are rendered and the
        nearest used.
        """
        width = max(1, round(k.width * k.fy / k.fx))
        rotation = map_from_optical.rotation
        x, y = near / k.fx, near / k.fy
        frustum = (-(k.cx + 0.5) * x, (k.width - 0.5 - k.cx) * x, -(k.height - 0.5 - k.cy) * y, (k.cy + 0.5) * y)
        image, depth = self._draw(
            map_from_optical.position,
            rotation[:, 2],
            -rotation[:, 1],
            frustum,
            (near, far),
            (width, k.height),
            segments,
        )
        if width != k.width:
            columns = np.minimum(((np.arange(k.width) + 0.5) * width / k.width).astype(int), width - 1)
            image, depth = image[:, columns], depth[:, columns]
        return image, depth

    def view(self, viewpoint: Viewpoint, width: int, height: int, segments: bool = False) -> NDArray[np.uint8]:
        """Render a picture with shadows on a white background, (H, W, 3), or ``segments`` instead."""
        eye, target = np.array(viewpoint.eye), np.array(viewpoint.target)
        forward = (target - eye) / np.linalg.norm(target - eye)
        side = np.cross(forward, (0.0, 0.0, 1.0))
        up = (
            np.cross(side / np.linalg.norm(side), forward) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
        )
        top = viewpoint.near * math.tan(math.radians(viewpoint.field_of_view) / 2.0)
        right = top * width / height
        frustum = (-right, right, -top, top)
        planes = viewpoint.near, FAR
        image, depth = self._draw(eye, forward, up, frustum, planes, (width, height), segments, shadows=True)
        return image if segments else np.where(depth[..., None] < 0.999 * FAR, image, np.uint8(255))

    def geoms(self, colors: NDArray[np.uint8]) -> NDArray[np.intp]:
        """Return the geom shown by each pixel of a segmentation image, -1 for none."""
        coded = colors.astype(np.intp) @ np.array([1, 1 << 8, 1 << 16])
        geoms = np.full(self._scene.ngeom + 1, -1)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.segid >= 0 and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geoms[geom.segid + 1] = geom.objid
        found: NDArray[np.intp] = geoms[coded]
        return found

    def _draw(
        self,
        eye: NDArray[np.float64],
        forward: NDArray[np.float64],
        up: NDArray[np.float64],
        frustum: tuple[float, float, float, float],
        planes: tuple[float, float],
        size: tuple[int, int],
        segments: bool,
        shadows: bool = False,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        self._start(size)
        scene, (left, right, bottom, top), (near, far) = self._scene, frustum, planes
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, scene
        )
        for camera in scene.camera:
            camera.pos, camera.forward, camera.up = eye, forward, up
            camera.frustum_center, camera.frustum_width = (left + right) / 2.0, (right - left) / 2.0
            camera.frustum_bottom, camera.frustum_top = bottom, top
            camera.frustum_near, camera.frustum_far = near, far
        flags = mujoco.mjtRndFlag
        for flag in (flags.mjRND_SEGMENT, flags.mjRND_IDCOLOR):
            scene.flags[flag] = segments
        scene.flags[flags.mjRND_SHADOW] = shadows and not segments
        for flag in (flags.mjRND_REFLECTION, flags.mjRND_SKYBOX, flags.mjRND_HAZE):
            scene.flags[flag] = False
        width, height = size
        rectangle = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(rectangle, scene, self._context)
        image, buffer = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
        mujoco.mjr_readPixels(image, buffer, rectangle, self._context)
        # MuJoCo's depth runs from 1 at the near plane to 0 at the far one.
        depth = near * far / (near + (far - near) * buffer[::-1].astype(np.float64))
        return image[::-1], depth

    def _start(self, size: tuple[int, int]) -> None:
        if self._gl is None:
            try:
                gl = _graphics(*size)
                gl.make_current()
                self._model.vis.global_.offwidth, self._model.vis.global_.offheight = size
                self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            except Exception as error:  # each platform and driver of OpenGL raises its own
                raise SimulationError(NO_RENDERER.format(error=error)) from error
            self._gl, self._size = gl, size
            self._scene = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom + 100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
            self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._gl.make_current()
        if size[0] > self._size[0] or size[1] > self._size[1]:
            self._size = max(size[0], self._size[0]), max(size[1], self._size[1])
            mujoco.mjr_resizeOffscreen(*self._size, self._context)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)


@contextmanager
def shown(parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]]) -> Iterator[Renderer]:
    """Yield a renderer of shapes with their colours, without a simulation."""
    shapes = Shapes(MujocoParameters())
    shapes.light()
    body = shapes.body(shapes.spec.worldbody, "object", Pose())
    shapes.geoms(body, [part for part, _ in parts], [(*color, 1.0) for _, color in parts], None)
    model = shapes.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = Renderer(model, data)
    try:
        yield renderer
    finally:
        renderer.close()


def render_object(
    parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]],
    viewpoint: Viewpoint,
    width: int = 480,
    height: int = 480,
) -> NDArray[np.uint8]:
    """Render shapes with their colours on white: (height, width, 3) uint8."""
    with shown(parts) as renderer:
        return smooth(renderer.view(viewpoint, 2 * width, 2 * height), 2)
