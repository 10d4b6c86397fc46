"""A policy server as openpi's: websockets and msgpack with its own array packing, in a process of its own.

    python openpi_server.py MODE

Prints its port. It shares no code with the client, so that both cannot be wrong alike. Modes: ``good`` answers 16
actions of 8 columns that repeat what was seen; ``one_each`` drops the connection after each answer; the others break
something.
"""

from __future__ import annotations

import sys
import time

import msgpack
import numpy as np
from websockets.sync.server import ServerConnection, serve


def encode(value):
    if isinstance(value, np.ndarray):
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    return value


def decode(value):
    if b"__ndarray__" in value:
        return np.ndarray(buffer=value[b"data"], dtype=np.dtype(value[b"dtype"]), shape=value[b"shape"])
    return value


def answer(seen: dict, mode: str) -> dict:
    actions = np.zeros((16, 8), dtype=np.float32)
    actions[:, :7] = seen["observation/joint_position"]
    actions[:, 7] = seen["observation/gripper_position"]
    actions[:, 0] += np.arange(16) * 0.01
    if mode == "nan":
        actions[3, 2] = np.nan
    if mode == "narrow":
        actions = actions[:, :5]
    reply = {"actions": actions, "server_timing": {"infer_ms": np.float64(1.5)}}
    for key, image in seen.items():
        if key.startswith("observation/exterior"):
            reply["state"] = {"image_shape": list(image.shape), "brightest": int(image.max()), "prompt": seen["prompt"]}
    if mode == "nothing":
        del reply["actions"]
    return reply


def handler(mode: str):
    def handle(connection: ServerConnection) -> None:
        connection.send(b"\xc1" if mode == "no_metadata" else msgpack.packb({"model": "tiny", "mode": mode}))
        for message in connection:
            if mode == "silent":
                time.sleep(30.0)
            if mode == "traceback":
                connection.send("Traceback (most recent call last):\n  ...\nKeyError: 'observation/state'")
                return
            if mode == "garbage":
                connection.send(b"\xc1\x00")
                return
            seen = msgpack.unpackb(message, object_hook=decode)
            connection.send(msgpack.packb(answer(seen, mode), default=encode))
            if mode == "one_each":
                return

    return handle


if __name__ == "__main__":
    with serve(handler(sys.argv[1]), "127.0.0.1", 0, compression=None, max_size=None) as server:
        sys.stdout.write(f"{server.socket.getsockname()[1]}\n")
        sys.stdout.flush()
        server.serve_forever()
