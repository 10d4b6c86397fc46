"""Videos of a dataset, encoded frame by frame with PyAV: H.264 with a keyframe every second frame."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import require_extra

CODEC = "h264"
ENCODER = "libx264"
# With one thread, the file does not depend on the number of cores; without B-frames, each frame is decoded at once.
_OPTIONS = {"crf": "23", "g": "2", "bf": "0", "preset": "veryfast", "threads": "1"}


class VideoFile:
    """A video that is being written, until ``close``.

    ``size``: (H, W), even. Raises MissingExtraError without PyAV, OSError if the file cannot be written.
    """

    def __init__(self, path: Path, fps: int, size: tuple[int, int]) -> None:
        require_extra("writing videos", "video")
        import av

        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self._frame = path, av.VideoFrame.from_ndarray
        self._container: Any = av.open(str(path), "w", format="mp4")
        stream: Any = self._container.add_stream(ENCODER, rate=fps, options=dict(_OPTIONS))
        (stream.height, stream.width), stream.pix_fmt = size, "yuv420p"
        self._stream = stream
        self._time_base, self._count = Fraction(1, fps), 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Encode the next (H, W, 3) RGB picture."""
        frame = self._frame(np.ascontiguousarray(picture), format="rgb24")
        frame.pts, frame.time_base = self._count, self._time_base
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write the data buffered in the encoder; idempotent."""
        container, self._container = self._container, None
        if container is None:
            return
        try:
            container.mux(self._stream.encode(None))
        finally:
            container.close()


def pictures(path: Path, start: float, end: float) -> Iterator[NDArray[np.uint8]]:
    """Yield the (H, W, 3) RGB pictures of a video from ``start`` to before ``end``, seconds."""
    require_extra("reading videos", "video")
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.time_base is not None
        container.seek(round(start / stream.time_base), stream=stream)
        for frame in container.decode(stream):
            assert frame.time is not None
            if frame.time >= end - 1e-4:
                return
            if frame.time >= start - 1e-4:
                yield np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
