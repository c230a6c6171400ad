"""The benchmark's problem, its costs with OpenCV, timing, and the processor."""

import platform
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import PARENTS
from posefit.motion import built_in
from posefit.silhouette.cost import mismatch, project
from posefit.silhouette.mask import Silhouette
from posefit.testing.problem import walking_angles
from posefit_priors.pca import COMPONENTS, PCA

SIZE = (320, 240)  # pixels
ROUNDS = 12  # in a round each job runs; the fastest run of each counts
TURN = 0.05  # seconds: a job is repeated until its turn is over


def fastest(jobs: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """Return the seconds of the fastest run of each job.

    Jobs take turns, so that a slow moment of the machine affects all of them.
    """
    seconds = dict.fromkeys(jobs, np.inf)
    # not timed: the first call compiles
    for job in jobs.values():
        job()
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            until = time.perf_counter() + TURN
            ended = -np.inf
            while ended < until:  # at least once
                began = time.perf_counter()
                job()
                ended = time.perf_counter()
                seconds[name] = min(seconds[name], ended - began)
    return seconds


def processor() -> dict[str, str]:
    """Return the names of the processor and of LLVM's target for compiled loops."""
    from numba.core.registry import cpu_target

    listed = Path("/proc/cpuinfo")
    if listed.exists():
        lines = listed.read_text().splitlines()
    else:
        lines = []
    name = platform.processor() or platform.machine()
    for line in lines:
        if line.startswith("model name"):
            name = line.partition(":")[2].strip()
            break
    _, compiled_for, _ = cpu_target.target_context.codegen().magic_tuple()
    return {"name": name, "compiled_for": compiled_for}


def bench_cost(
    threads: int = 1,
    *,
    width: int = SIZE[0],
    views: int = 1,
    components: int = COMPONENTS,
) -> SilhouetteCost:
    """Return the benchmark's cost, with a PCA prior.

    The observed mask is a frame of the built-in walk that fills the image.

    Args:
        threads: The number of threads.
        width: Pixels of the image's width; the height is three quarters of it.
        views: The number of cameras, evenly around the person.
        components: The number of components of the prior.

    Returns:
        The cost.
    """
    motion = built_in.motion("walk", frames=1, fps=30.0)
    body = Body.of(motion.skeleton)
    prior = PCA(components=components).fit(walking_angles())
    joints = motion.skeleton.joints(motion.poses, motion.translations)[0]
    yaws = motion.poses[0, 0] + np.radians(45.0 + 360.0 / views * np.arange(views))
    cameras = []
    for yaw in yaws:
        size = (width, 3 * width // 4)
        cameras.append(Camera.framing(joints, body.joint_radii(), yaw, size))
    space = SearchSpace(
        prior,
        np.array([motion.poses[0, 0], 0.0, 0.0]),
        np.radians([45.0, 15.0, 15.0]),
        motion.translations[0],
    )
    silhouettes = []
    for camera in cameras:
        mask = project(body, camera, motion.poses[0], motion.translations[0])
        silhouettes.append(Silhouette.of(mask))
    return SilhouetteCost(body, cameras, silhouettes, space, threads=threads)


def opencv_costs(cost: SilhouetteCost, proposals: Array) -> Array:
    """Return the costs (n,) of proposals, with OpenCV instead of the kernel.

    Kinematics, prior and outlines are computed for all n poses at once in NumPy. OpenCV
    then draws each bone into an image of bytes, as two circles and a quadrilateral with
    corners at 1/16 pixel, and counts the pixels.
    """
    body = cost.body
    camera = cost.cameras[0]
    silhouette = cost.silhouettes[0]
    poses, translations = cost.decode(proposals)
    pixels, depths = camera.project(body.skeleton.joints(poses, translations))
    scale = np.sqrt(camera.focal.prod()) / depths
    parents = np.array(PARENTS[1:])
    first = pixels[:, parents]
    second = pixels[:, 1:]
    radius0 = scale[:, parents] * body.radii[:, 0]
    radius1 = scale[:, 1:] * body.radii[:, 1]
    axis = second - first
    square = (axis**2).sum(axis=-1)
    # the outer tangents touch both circles in the directions `up` and `down`
    taper = radius0 - radius1  # (n, 26)
    height = np.sqrt(np.maximum(square - taper**2, 0.0))
    along = (taper / square)[..., None]
    across = (height / square)[..., None]
    normal = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    up = along * axis + across * normal
    down = along * axis - across * normal
    r0 = radius0[..., None]
    r1 = radius1[..., None]
    corners = np.stack(
        [first + r0 * up, second + r1 * up, second + r1 * down, first + r0 * down],
        axis=2,
    )
    corners = np.rint((corners - 0.5) * 16).astype(np.int32)
    starts = np.rint((first - 0.5) * 16).astype(int).tolist()
    ends = np.rint((second - 0.5) * 16).astype(int).tolist()
    start_radii = np.rint(radius0 * 16).astype(int).tolist()
    end_radii = np.rint(radius1 * 16).astype(int).tolist()
    observed = silhouette.mask.view(np.uint8)
    total = cv2.countNonZero(observed)
    image = np.zeros_like(observed)
    areas = np.empty((len(proposals), 3), dtype=np.int64)
    for i in range(len(proposals)):
        image[:] = 0
        for j in range(len(parents)):
            cv2.fillConvexPoly(image, corners[i, j], 1, cv2.LINE_8, 4)
            cv2.circle(image, starts[i][j], start_radii[i][j], 1, -1, cv2.LINE_8, 4)
            cv2.circle(image, ends[i][j], end_radii[i][j], 1, -1, cv2.LINE_8, 4)
        overlap = cv2.countNonZero(cv2.bitwise_and(image, observed))
        areas[i] = total - overlap, cv2.countNonZero(image) - overlap, overlap
    return mismatch(areas)
