"""The areas of thousands of poses, counted on a device in parts.

While one part is counted, the next one is copied. Bodies, cameras and silhouettes are
copied to the device once, and are kept there until the objects are deleted.
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
# poses of a part: 35 MB. At most two parts are on the device at once.
PART = 65_536


def areas_on_device(
    body: Body,
    camera: Camera,
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
) -> Areas:
    """Return R, B, Y (n, 3) in pixels of poses (n, 66) at translations (n, 3).

    The areas are counted on the device. Callers check the shapes.
    """
    out = np.empty((len(poses), 3), dtype=np.int64)
    drawing = drawing_on_device(body, camera, silhouette)
    streams = (cuda.stream(), cuda.stream())
    waiting = deque[tuple[slice, Any, Any]]()
    cuda.synchronize()  # wait until the arrays of the drawing have been copied

    def collect() -> None:
        part, areas, stream = waiting.popleft()
        out[part] = areas.copy_to_host(stream=stream)

    for k, first in enumerate(range(0, len(poses), PART)):
        part = slice(first, first + PART)
        stream = streams[k % 2]
        moved = cuda.to_device(poses[part], stream=stream)
        places = cuda.to_device(translations[part], stream=stream)
        areas = cuda.device_array((len(moved), 3), np.int32, stream=stream)
        count_on_device[len(moved), THREADS, stream](*drawing, moved, places, areas)
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

    def words_of_silhouette() -> Sequence[Any]:
        person, valid = silhouette.bits
        return person.view(np.uint32), valid.view(np.uint32), [silhouette.pixels]

    words = _there(silhouette, words_of_silhouette)
    return Chain(*bones), radii, *seen_by, (camera.width, camera.height), tuple(words)


def _there(owner: Any, arrays: Callable[[], Sequence[Any]]) -> Sequence[Any]:
    """Return an owner's arrays on the device; the first call copies them."""
    if owner not in _held:
        copies = [cuda.to_device(np.array(array, order="C")) for array in arrays()]
        _held[owner] = tuple(copies)
    return _held[owner]
