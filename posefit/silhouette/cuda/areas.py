"""The areas of thousands of poses, counted on a device in parts: while one part is counted, the next one is copied.

Bodies, cameras and silhouettes are copied to the device once, and stay there as long as they live.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.cuda.launch import THREADS, count_on_device
from posefit.silhouette.mask import Silhouette

T = TypeVar("T")
_held: WeakKeyDictionary[Any, Sequence[Any]] = WeakKeyDictionary()
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


def held(owner: T, arrays: Callable[[T], Sequence[NDArray[Any]]]) -> Sequence[Any]:
    """Return the arrays of an owner on the device, given to it at the first call."""
    arrays_there = _held.get(owner)
    if arrays_there is None:
        arrays_there = _held[owner] = tuple(cuda.to_device(np.array(one, order="C")) for one in arrays(owner))
    return arrays_there


def drawing_on_device(body: Body, camera: Camera, silhouette: Silhouette) -> tuple[Any, ...]:
    """Return the arguments of `count_on_device` that come before the poses."""
    scene = *held(body, _body), *held(camera, _camera), camera.width, camera.height
    return *scene, *held(silhouette, _silhouette)


def _body(body: Body) -> Sequence[NDArray[Any]]:
    chain = body.skeleton.chain
    return chain.parents, chain.angles, chain.turned, chain.turns, chain.offsets, body.radii


def _camera(camera: Camera) -> Sequence[NDArray[Any]]:
    return [np.concatenate([camera.rotation.ravel(), camera.translation, camera.focal, camera.centre])]


def _silhouette(silhouette: Silhouette) -> Sequence[NDArray[Any]]:
    """Return the observed and the known pixels (1, strips, rows) of 32-bit words, and how many are observed (1,)."""
    observed, valid = (bits.view(np.uint32)[None] for bits in silhouette.bits)
    return observed, valid, np.array([silhouette.pixels], dtype=np.int64)
