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
    found = _held.get(owner)
    if found is None:
        found = _held[owner] = tuple(cuda.to_device(np.array(one, order="C")) for one in arrays(owner))
    return found


def drawing_on_device(body: Body, camera: Camera, silhouettes: Sequence[Silhouette]) -> tuple[Any, ...]:
    """Return what `count_on_device` wants to know before the poses, of one silhouette or several of one camera."""
    if len(silhouettes) == 1:
        seen = held(silhouettes[0], lambda one: _seen([one]))
    else:
        seen = [cuda.to_device(one) for one in _seen(silhouettes)]
    return *held(body, _body), *held(camera, _camera), camera.width, camera.height, *seen


def _body(body: Body) -> Sequence[NDArray[Any]]:
    chain = body.skeleton.chain
    return chain.parents, chain.angles, chain.turned, chain.turns, chain.offsets, body.radii


def _camera(camera: Camera) -> Sequence[NDArray[Any]]:
    return [np.concatenate([camera.rotation.ravel(), camera.translation, camera.focal, camera.centre])]


def _seen(silhouettes: Sequence[Silhouette]) -> Sequence[NDArray[Any]]:
    """Return the observed and the known pixels (silhouettes, strips, rows) of 32-bit words, and how many are seen."""
    observed, valid = (
        np.stack([bits.view(np.uint32) for bits in planes])
        for planes in zip(*(one.bits for one in silhouettes), strict=True)
    )
    return observed, valid, np.array([one.pixels for one in silhouettes], dtype=np.int64)
