"""Thousands of poses, counted on a device in parts: while one part is counted, the next one is on its way."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.cuda.held import drawing_on_device
from posefit.silhouette.cuda.launch import MOST, THREADS, count_on_device
from posefit.silhouette.mask import Silhouette

PART = 65_536  # poses: 35 MB; two parts at a time are on the device, however many there are


def counted(
    body: Body, camera: Camera, silhouettes: Sequence[Silhouette], poses: Array, translations: Array
) -> NDArray[np.int64]:
    """Return R, B, Y (n, silhouettes, 3) in pixels of poses (n, 66) at translations (n, 3), counted on the device.

    Poses are drawn once for every `MOST` silhouettes. Shapes are checked by the callers.
    """
    out = np.empty((len(poses), len(silhouettes), 3), dtype=np.int64)
    for first in range(0, len(silhouettes), MOST):
        some = slice(first, first + MOST)
        _count(drawing_on_device(body, camera, silhouettes[some]), poses, translations, out[:, some])
    return out


def launched(drawing: Sequence[Any], poses: Any, translations: Any, silhouettes: int, stream: Any = 0) -> Any:
    """Return R, B, Y (n, silhouettes, 3), int32, on the device as its arrays of poses and translations are.

    It comes back before anything is counted; who copies what it returns waits.
    """
    areas = cuda.device_array((len(poses), silhouettes, 3), np.int32, stream=stream)
    if len(poses):
        count_on_device[len(poses), THREADS, stream](*drawing, poses, translations, areas)
    return areas


def _count(drawing: Sequence[Any], poses: Array, translations: Array, out: NDArray[np.int64]) -> None:
    streams, waiting = (cuda.stream(), cuda.stream()), deque[tuple[slice, Any, Any]]()
    cuda.synchronize()  # what the drawing is made of has arrived

    def collect() -> None:
        part, areas, stream = waiting.popleft()
        out[part] = areas.copy_to_host(stream=stream)

    for k, first in enumerate(range(0, len(poses), PART)):
        part, stream = slice(first, first + PART), streams[k % 2]
        there, where = (cuda.to_device(one[part], stream=stream) for one in (poses, translations))
        waiting.append((part, launched(drawing, there, where, out.shape[1], stream), stream))
        if len(waiting) == len(streams):
            collect()
    while waiting:
        collect()
