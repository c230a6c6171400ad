"""The areas of thousands of poses, counted on a device in parts: while one part is counted, the next one is copied.

Bodies, cameras and silhouettes are copied to the device once, and stay there as long as they live.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numba import cuda

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.kernels import Chain
from posefit.silhouette.mask import Areas, Silhouette
from posefit_cuda.launch import THREADS, count_on_device

_held: WeakKeyDictionary[Any, Sequence[Any]] = WeakKeyDictionary()
# poses: 35 MB; two parts at a time are on the device, however many there are
PART = 65_536


def areas_on_device(
    body: Body,
    camera: Camera,
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
) -> Areas:
    """Return R, B, Y (n, 3) in pixels of poses (n, 66) at translations (n, 3), counted on the device.

    Shapes are checked by the callers.
    """
    out = np.empty((len(poses), 3), dtype=np.int64)
    drawing = drawing_on_device(body, camera, silhouette)
    streams = (cuda.stream(), cuda.stream())
    waiting = deque[tuple[slice, Any, Any]]()
    cuda.synchronize()  # what the drawing is made of has arrived

    def collect() -> None:
        part, areas, stream = waiting.popleft()
        out[part] = areas.copy_to_host(stream=stream)

    for k, first in enumerate(range(0, len(poses), PART)):
        part = slice(first, first + PART)
        stream = streams[k % 2]
        there, where = (
            cuda.to_device(values[part], stream=stream)
            for values in (poses, translations)
        )
        areas = cuda.device_array((len(there), 3), np.int32, stream=stream)
        count_on_device[len(there), THREADS, stream](*drawing, there, where, areas)
        waiting.append((part, areas, stream))
        if len(waiting) == len(streams):
            collect()
    while waiting:
        collect()
    return out


def drawing_on_device(
    body: Body, camera: Camera, silhouette: Silhouette
) -> tuple[Any, ...]:
    """Return the arguments of `count_on_device` that come before the poses."""
    chain = body.skeleton.chain
    view = (camera.rotation.ravel(), camera.translation, camera.focal, camera.centre)
    *bones, radii = _there(body, lambda: (*chain, body.radii))
    seen_by = _there(camera, lambda: (np.concatenate(view),))
    words = _there(
        silhouette,
        lambda: (
            *(bits.view(np.uint32) for bits in silhouette.bits),
            [silhouette.pixels],
        ),
    )
    return Chain(*bones), radii, *seen_by, (camera.width, camera.height), tuple(words)


def _there(owner: Any, arrays: Callable[[], Sequence[Any]]) -> Sequence[Any]:
    """Return the arrays of an owner on the device, given to it at the first call."""
    if owner not in _held:
        _held[owner] = tuple(
            cuda.to_device(np.array(array, order="C")) for array in arrays()
        )
    return _held[owner]
