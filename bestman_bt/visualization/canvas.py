"""A camera's picture that is drawn on in metres of the frame in which the camera's pose is known."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.visualization.label_layout import Label, Rectangle, place_labels
from bestman_bt.visualization.marks import Color

FONT = cv2.FONT_HERSHEY_SIMPLEX
FONT_SIZE = 0.5
PADDING = 4
"""Pixels between a label's text and its border."""
PAPER: Color = (30, 30, 30)
INK: Color = (255, 255, 255)


class Canvas:
    """``scale`` times as large as the image; ``pixels``: (H, W, 3) uint8 rgb, complete after ``finish``."""

    def __init__(self, image: RGBDImage, frame_from_camera: Pose, scale: int) -> None:
        size = (image.intrinsics.width * scale, image.intrinsics.height * scale)
        self.pixels: NDArray[np.uint8] = np.ascontiguousarray(
            cv2.resize(image.rgb, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8
        )
        self._scale = scale
        self._image = image
        self._camera_from_frame = frame_from_camera.inverse()
        self._labels: list[tuple[Label, str, Color]] = []
        self._kept_clear: list[Rectangle] = []

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (N, 2) of the canvas, where points (N, 3) are; NaN behind the camera."""
        k = self._image.intrinsics
        x, y, z = self._camera_from_frame.apply(np.atleast_2d(points)).T
        z = np.where(z > 0.02, z, np.nan)
        # The middle of the image's pixel (0, 0) lies at (0, 0); that of the canvas lies half a pixel of its own inside.
        return (np.column_stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z]) + 0.5) * self._scale - 0.5

    def inside(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which pixels (N, 2) lie on the canvas: (N,)."""
        limit = np.array(self.pixels.shape[1::-1])
        return np.asarray(((pixels >= 0) & (pixels < limit)).all(axis=1))  # NaN is not

    def seen(self, points: NDArray[np.float64], margin: float) -> NDArray[np.bool_]:
        """Which of the points (N, 3) the image shows: not those with measured depth ``margin`` metres before them."""
        pixels = self.project(points)
        seen = self.inside(pixels)
        columns, rows = (pixels[seen] / self._scale).astype(int).T
        measured = self._image.depth[rows, columns]
        depth = self._camera_from_frame.apply(points[seen])[:, 2]
        seen[seen] = (measured <= 0.0) | (measured > depth - margin)
        return seen

    def lines(self, segments: NDArray[np.float64], color: Color, thickness: int = 2) -> None:
        """Segments (N, 2, 3) metres."""
        ends = self.project(segments.reshape(-1, 3)).reshape(-1, 2, 2)
        for first, second in ends[np.isfinite(ends).all(axis=(1, 2))]:
            cv2.line(self.pixels, _pixel(first), _pixel(second), color, thickness, cv2.LINE_AA)

    def mask(self, points: NDArray[np.float64], color: Color, opacity: float = 0.45) -> None:
        """Tint the pixels of measured points (N, 3) metres, and draw a line around them."""
        covered = np.zeros(self.pixels.shape[:2], dtype=np.uint8)
        for place in self.project(points):
            cv2.circle(covered, _pixel(place), 2 * self._scale, 1, -1)
        covered = np.asarray(cv2.morphologyEx(covered, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)), np.uint8)
        chosen = covered > 0
        tinted = (1 - opacity) * self.pixels[chosen] + opacity * np.array(color)
        self.pixels[chosen] = tinted.astype(np.uint8)
        outlines, _ = cv2.findContours(covered, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(self.pixels, outlines, -1, color, 1, cv2.LINE_AA)

    def keep_clear(self, points: NDArray[np.float64]) -> None:
        """No label should cover the rectangle around points (N, 3) metres."""
        pixels = self.project(points)
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if len(pixels):
            (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
            self._kept_clear.append((float(left), float(top), float(right), float(bottom)))

    def label(self, point: NDArray[np.float64], text: str, color: Color) -> None:
        """A text near a point (3,) metres; none where that is not in the picture."""
        place = self.project(point)
        if self.inside(place)[0]:
            (width, height), base = cv2.getTextSize(text, FONT, FONT_SIZE, 1)
            size = (width + 2 * PADDING, height + base + 2 * PADDING)
            self._labels.append((Label((float(place[0, 0]), float(place[0, 1])), size), text, color))

    def finish(self) -> NDArray[np.uint8]:
        """Draw the labels, now that everything that they should not cover is known; returns ``pixels``."""
        picture = (float(self.pixels.shape[1]), float(self.pixels.shape[0]))
        places = place_labels([label for label, _, _ in self._labels], self._kept_clear, picture)
        labelled = list(zip(self._labels, places, strict=True))
        for (label, _, color), (left, top, right, bottom) in labelled:
            x, y = label.anchor
            nearest = np.array([min(max(x, left), right), min(max(y, top), bottom)])
            cv2.line(self.pixels, _pixel(np.array([x, y])), _pixel(nearest), color, 1, cv2.LINE_AA)
        for (_, text, color), (left, top, right, bottom) in labelled:
            corners = _pixel(np.array([left, top])), _pixel(np.array([right, bottom]))
            cv2.rectangle(self.pixels, *corners, PAPER, -1)
            cv2.rectangle(self.pixels, *corners, color, 1)
            (_, height), _ = cv2.getTextSize(text, FONT, FONT_SIZE, 1)
            foot = _pixel(np.array([left + PADDING, top + PADDING + height]))
            cv2.putText(self.pixels, text, foot, FONT, FONT_SIZE, INK, 1, cv2.LINE_AA)
        return self.pixels


def _pixel(place: NDArray[np.float64]) -> tuple[int, int]:
    near = np.clip(place, -1e4, 1e4)
    return round(float(near[0])), round(float(near[1]))
