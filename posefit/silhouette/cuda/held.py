"""Arrays that a device is given once, and keeps for as long as the body, camera or silhouette lives."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Silhouette

T = TypeVar("T")
_held: WeakKeyDictionary[Any, Sequence[Any]] = WeakKeyDictionary()


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
