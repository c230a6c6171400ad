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
from posefit.silhouette.cuda.launch import THREADS, count_on_device
from posefit.silhouette.mask import Silhouette

PART = 65_536  # poses: 35 MB; two parts at a time are on the device, however many there are


def areas_on_device(
    body: Body, camera: Camera, silhouette: Silhouette, poses: Array, translations: Array
) -> NDArray[np.int64]:
    """Return R, B, Y (n, 3) in pixels of poses (n, 66) at translations (n, 3), counted on the device.

    Shapes are checked by the callers.
    """
    out = np.empty((len(poses), 3), dtype=np.int64)
    _count(drawing_on_device(body, camera, silhouette), poses, translations, out)
    return out


def launched(drawing: Sequence[Any], poses: Any, translations: Any, stream: Any = 0) -> Any:
    """Return R, B, Y (n, 1, 3), int32, on the device, as its arrays of poses and translations are.

    It returns before anything is counted; copying the result waits for it.
    """
    areas = cuda.device_array((len(poses), 1, 3), np.int32, stream=stream)
    if len(poses):
        count_on_device[len(poses), THREADS, stream](*drawing, poses, translations, areas)
    return areas


def _count(drawing: Sequence[Any], poses: Array, translations: Array, out: NDArray[np.int64]) -> None:
    streams, waiting = (cuda.stream(), cuda.stream()), deque[tuple[slice, Any, Any]]()
    cuda.synchronize()  # what the drawing is made of has arrived

    def collect() -> None:
        part, areas, stream = waiting.popleft()
        out[part] = areas.copy_to_host(stream=stream)[:, 0]

    for k, first in enumerate(range(0, len(poses), PART)):
        part, stream = slice(first, first + PART), streams[k % 2]
        there, where = (cuda.to_device(one[part], stream=stream) for one in (poses, translations))
        waiting.append((part, launched(drawing, there, where, stream), stream))
        if len(waiting) == len(streams):
            collect()
    while waiting:
        collect()
