"""The two-way silhouette cost of many poses, over one view or several."""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette import drawn, kernels
from posefit.silhouette.mask import Mask, Silhouette, unpack
from posefit.silhouette.rasteriser import View

SCALE = 100.0  # S
BETA = 0.5  # beta
LEAST_SHARE = 16  # poses; a smaller share of work is not worth handing to another thread

Areas = NDArray[np.int64]  # (n, 3): R, B, Y


def view_of(camera: Camera) -> View:
    """Return a camera as the kernel wants it."""
    return View(camera.rotation, camera.translation, camera.focal, camera.centre, camera.width, camera.height)


def areas(
    body: Body, camera: Camera, silhouette: Silhouette, poses: Array, translations: Array, threads: int = 1
) -> Areas:
    """Return R, B, Y (n, 3) in pixels of poses (n, 66) with their root at translations (n, 3). SAPSO (3).

    R is silhouette without body, B body without silhouette, Y both; unknown pixels are in none. A bone with an end
    nearer than 5 cm or behind the camera is not drawn. The counts do not depend on n or `threads`.
    """
    # Fresh, writeable arrays: numba would compile another kernel for read-only ones.
    poses, translations = writeable(poses), writeable(translations)
    n = len(poses)
    if poses.ndim != 2 or poses.shape[1] != ANGLES:
        raise ValueError(f"poses must have shape (n, {ANGLES}), got {poses.shape}")
    if translations.shape != (n, 3):
        raise ValueError(f"translations must have shape {(n, 3)}, got {translations.shape}")
    if silhouette.mask.shape != (camera.height, camera.width):
        raise ValueError(f"mask must have shape {(camera.height, camera.width)}, got {silhouette.mask.shape}")
    drawn.count_poses(n, silhouette)
    out = np.empty((n, 3), dtype=np.int64)
    chain, radii, view = body.skeleton.chain, body.radii, view_of(camera)
    observed, valid = silhouette.bits

    shares = min(threads, n // LEAST_SHARE)
    if shares <= 1:
        kernels.count_areas(chain, radii, view, observed, valid, poses, translations, out)  # SAPSO (3)
        return out

    def work(part: slice) -> None:
        kernels.count_areas(chain, radii, view, observed, valid, poses[part], translations[part], out[part])

    cuts = [n * share // shares for share in range(shares + 1)]
    others = [_submit(threads, work, slice(a, b)) for a, b in pairwise(cuts[1:])]
    work(slice(0, cuts[1]))
    for other in others:
        other.result()
    return out


def mismatch(areas: Areas, beta: float = BETA) -> Array:
    """Return the cost (n,) of areas R, B, Y (n, 3), 0 to 100. SAPSO (4), Reading S2."""
    costs = np.zeros(len(areas))
    kernels.add_mismatch(areas, SCALE, beta, costs)
    return costs


def project(body: Body, camera: Camera, pose: Array, translation: Array) -> Mask:
    """Return the mask (height, width) of one body, pose (66,), root at translation (3,)."""
    if np.shape(pose) != (ANGLES,) or np.shape(translation) != (3,):
        came = f"{np.shape(pose)} and {np.shape(translation)}"
        raise ValueError(f"pose and translation must have shapes {(ANGLES,)} and (3,), got {came}")
    drawn.count_poses(1)
    bits = kernels.draw_bits(
        body.skeleton.chain,
        body.radii,
        view_of(camera),
        writeable(pose),
        writeable(translation),
    )
    return unpack(bits, camera.width)


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads - 1, thread_name_prefix="posefit")


if hasattr(os, "register_at_fork"):
    # The threads of a pool do not live on in a forked child; without this its first call would wait for ever.
    os.register_at_fork(after_in_child=_pool.cache_clear)


def _submit(threads: int, work: Callable[[slice], None], part: slice) -> "Future[None]":
    return _pool(threads).submit(work, part)
