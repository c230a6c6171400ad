"""The figures of a track and of each frame: errors, baselines, certainty, steadiness.

`FRAME` defines the columns of frames.csv, and `evaluated` computes them.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.measures import MEASURES, Effort, Measure, Measures, Spread
from posefit.fitting import metrics
from posefit.fitting.prior import Latents
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import Skeleton
from posefit.motion.steadiness import acceleration, slides, standing
from posefit.silhouette.cost import BETA, pose_costs
from posefit.silhouette.mask import coarser_camera, coarser_silhouette
from posefit.uncertainty.calibration import LEVELS, MAIN_LEVEL, reliability
from posefit.uncertainty.intervals import joint_intervals
from posefit.uncertainty.modes import likeliest_is_right, nearer_mirrored, unknown_sides

# If there are more training poses than this, `nearest` has two rounds. In the first,
# every fourth pose is rendered in a small picture. In the second, the best of these and
# their neighbours in the clip are rendered at full size.
MAX_FULL_SIZE_POSES = 8_000
SMALL_STRIDE = 4
FULL_SIZE_CANDIDATES = 200
# the smallest side of a small picture in pixels, and its largest reduction
MIN_SMALL_SIDE = 60
MAX_SMALL_FACTOR = 4
LOST = 0.5  # frames with at least this probability are called lost
MAX_TRACE_POINTS = 64

_FRAME_MEASURES = (
    Measure("frame", "frame", "", 0, "number of the frame in the footage, from 0"),
    Measure("seconds", "seconds", "s", 2, "time of the frame in the footage, from 0"),
    MEASURES["cost"],
    MEASURES["iou"],
    Measure(
        "usable",
        "usable",
        "",
        0,
        "1 where the frame was searched, 0 where the pose was held",
    ),
    MEASURES["error_degrees"],
    MEASURES["geodesic_degrees"],
    MEASURES["mpjpe_mm"],
    MEASURES["pa_mpjpe_mm"],
    Measure(
        "swapped",
        "swapped",
        "",
        0,
        "1 where the frame is nearer to the truth when mirrored",
    ),
    Measure(
        "unknown_sides",
        "sides unknown",
        "",
        0,
        "1 where left and right are unknown; blank where not estimated",
    ),
    Measure(
        "lost",
        "lost",
        "",
        2,
        "probability that the frame is lost; blank where not estimated",
    ),
    Measure(
        "interval_mm",
        "80 % interval",
        "mm",
        0,
        "mean radius of the 80 % intervals of the joints; blank where not estimated",
    ),
    MEASURES["evaluations"],
    Measure(
        "wall_seconds",
        "time",
        "ms",
        1,
        "wall time of the estimate, from the end of the previous frame's",
        1e3,
    ),
    Measure(
        "activity",
        "activity",
        "",
        0,
        "the person's activity in a word; blank where not estimated",
    ),
)
FRAME = {measure.name: measure for measure in _FRAME_MEASURES}
# columns (T,) by the names of `FRAME`, NaN where a value is unknown
Table = dict[str, Array]


def unseen(table: Table) -> set[int]:
    """Return the numbers in the footage of frames that were held or are called lost.

    Files leave the values of these frames blank.
    """
    is_unseen = (table["usable"] == 0.0) | (table["lost"] >= LOST)
    return set(table["frame"][is_unseen].tolist())


class Flagged(NamedTuple):
    """The frames that are called lost, or whose sides are called unknown."""

    frames: NDArray[np.bool_]  # (T,)
    known: int  # the number of frames for which it is known


def flagged(table: Table, name: str) -> Flagged | None:
    """Return the frames that are called lost, or whose sides are called unknown.

    Only frames that show enough of the person count: in the others the pose was held,
    not searched. Counts and shares of both kinds are all taken from here.

    Args:
        table: The columns.
        name: `lost` or `unknown_sides`.

    Returns:
        The frames, or None if it is unknown for every frame.
    """
    least = {"lost": LOST, "unknown_sides": 1.0}[name]
    known = (table["usable"] == 1.0) & np.isfinite(table[name])
    if not known.any():
        return None
    return Flagged(known & (table[name] >= least), int(known.sum()))


def flagged_share(table: Table, name: str) -> float | None:
    """Return the share of the frames that `flagged` returns, None if it is unknown."""
    frames = flagged(table, name)
    if frames is None:
        return None
    return float(frames.frames.sum()) / frames.known


def evaluated(
    scene: Scene,
    frames: Sequence[Frame],
    prior: Latents | None,
    training: Array | None,
    beta: float,
    effort: Effort,
) -> tuple[Table, Measures]:
    """Return the figures of each frame, and of the whole track.

    Baselines have the true root and translation, which a tracker does not have:

    - `mean_pose` is the mean of the training poses.
    - `persistence` is the true pose of the first frame.
    - `nearest` is the training pose with the lowest cost in each frame.

    `prior_floor_degrees` is the error of the truth projected into the prior. It is a
    lower limit only for a linear prior.

    Args:
        scene: The observations, and the truth if it is known.
        frames: The tracked frames.
        prior: The prior of the method, or None.
        training: The training poses (n, 63). Only errors against a truth need them.
        beta: The weight in the cost of a pose.
        effort: The seconds and the evaluations that the track took.

    Returns:
        The columns of frames.csv, and the figures of the track.
    """
    cost = np.array([frame.cost for frame in frames])
    held = np.zeros(len(frames), dtype=bool)
    iou = np.empty(len(frames))  # the mean over the cameras that saw something
    # one pass, because observations of a known motion are rendered each time
    for k, observation in enumerate(scene.observations):
        known = [silhouette.known for silhouette in observation.silhouettes]
        by_view = metrics.iou(frames[k].areas)
        iou[k] = by_view[known if any(known) else slice(None)].mean()
        held[k] = not observation.usable
    # if no frame is usable, the figures are of all frames
    if held.all():
        usable = np.ones(len(frames), dtype=bool)
    else:
        usable = ~held
    errors, error_measures = _errors(scene, frames, prior, training, beta)
    certainty, certainty_measures = _certainty(scene, frames, errors.get("swapped"))
    evaluations = np.array([float(frame.evaluations) for frame in frames])
    table = {
        "frame": scene.first + np.arange(len(frames)),
        "seconds": (scene.first + np.arange(len(frames))) / scene.fps,
        "cost": cost,
        "iou": iou,
        "usable": 1.0 - held,
        **errors,
        **certainty,
        "evaluations": evaluations,
        "wall_seconds": np.array([frame.seconds for frame in frames]),
    }
    stages = effort.evaluations or {"frames": int(evaluations.sum())}
    total = sum(stages.values())
    measures = Measures(
        **error_measures,
        **certainty_measures,
        unknown_rate=flagged_share(table, "unknown_sides"),
        lost_flagged_rate=flagged_share(table, "lost"),
        **_steadiness(scene, frames),
        iou=float(iou[usable].mean()),
        cost=float(cost[usable].mean()),
        held_frames=int(held.sum()),
        seconds_per_frame=effort.seconds / len(frames),
        cpu_seconds_per_frame=effort.cpu_seconds / len(frames),
        evaluations=total,
        effort=stages,
        evaluations_per_second=total / effort.seconds,
    )
    return table, measures


def _errors(
    scene: Scene,
    frames: Sequence[Frame],
    prior: Latents | None,
    training: Array | None,
    beta: float,
) -> tuple[Table, dict[str, Any]]:
    """Return the columns and the figures that need the truth, none without it."""
    if scene.truth is None:
        return {}, {}
    assert training is not None
    truth = scene.truth.poses
    places = scene.truth.translations
    skeleton = scene.body.skeleton
    # the estimate has the given body, which may differ from the true one
    estimate = scene.motion(frames)
    poses = estimate.poses
    joints = estimate.joints
    true_joints = scene.truth.joints
    columns = {
        "error_degrees": metrics.pose_error_degrees(truth, poses),
        "geodesic_degrees": metrics.geodesic_degrees(truth, poses),
        "mpjpe_mm": metrics.mpjpe_mm(true_joints, joints),
        "pa_mpjpe_mm": metrics.pa_mpjpe_mm(true_joints, joints),
        "swapped": nearer_mirrored(true_joints, joints).astype(np.float64),
    }
    means = {name: float(values.mean()) for name, values in columns.items()}
    errors = columns["error_degrees"]

    def with_root(angles: Array) -> Array:
        """Return poses (T, 66) of joint angles (63,) or (T, 63) with the true root."""
        shape = (len(truth), truth.shape[1] - 3)
        return np.column_stack([truth[:, :3], np.broadcast_to(angles, shape)])

    def error_of(poses: Array) -> float:
        return float(metrics.pose_error_degrees(truth, poses).mean())

    # what can be reached without a search: a method has to beat all three
    nearest_poses = []
    for k, observation in enumerate(scene.observations):
        nearest_poses.append(nearest(scene, training, k, observation, beta))
    trivial = {
        "mean_pose": with_root(training.mean(axis=0)),
        "persistence": np.tile(truth[0], (len(truth), 1)),
        "nearest": np.array(nearest_poses),
    }
    baselines = {}
    baselines_mm = {}
    skills = {}
    for name, trivial_poses in trivial.items():
        baselines[name] = error_of(trivial_poses)
        trivial_joints = skeleton.joints(trivial_poses, places)
        baselines_mm[name] = float(metrics.mpjpe_mm(true_joints, trivial_joints).mean())
        skills[name] = metrics.skill(means["error_degrees"], baselines[name])
    # no search in the prior can do much better than the projected truth
    floor = None
    if prior is not None:
        projected = prior.inverse_transform(prior.transform(truth[:, 3:]))
        floor = error_of(with_root(projected))
    free_errors = metrics.pose_error_degrees(truth, poses, skeleton.free)
    spread = Spread(
        metrics.mean_error(errors), metrics.error_spread(errors), float(errors.max())
    )
    return columns, {
        "geodesic_degrees": means["geodesic_degrees"],
        "mpjpe_mm": means["mpjpe_mm"],
        "pa_mpjpe_mm": means["pa_mpjpe_mm"],
        "error_degrees": spread,
        "free_error_degrees": float(free_errors.mean()),
        "swap_rate": means["swapped"],
        "lost_rate": float(metrics.lost_rate(columns["mpjpe_mm"])),
        "skill": skills,
        "baselines_degrees": baselines,
        "baselines_mm": baselines_mm,
        "prior_floor_degrees": floor,
    }


def _certainty(
    scene: Scene, frames: Sequence[Frame], swapped: Array | None
) -> tuple[Table, dict[str, Any]]:
    """Return the columns and the figures of the method's certainty.

    Columns are NaN in frames whose certainty is unknown.
    """
    skeleton = scene.body.skeleton
    truth = scene.truth
    sides = np.full(len(frames), np.nan)
    radius_mm = np.full(len(frames), np.nan)
    lost = np.full(len(frames), np.nan)
    inside: list[NDArray[np.bool_]] = []
    radii_mm: list[Array] = []
    for k, frame in enumerate(frames):
        if frame.lost is not None:
            lost[k] = frame.lost
        if frame.posterior is None:
            continue
        sides[k] = unknown_sides(skeleton, frame.posterior, frame.pose)
        # (levels, 26): joints are relative to the root, so it is left out
        radii = joint_intervals(skeleton, frame.posterior, frame.pose)[:, 1:]
        radii_mm.append(1e3 * radii)
        radius_mm[k] = radii_mm[-1][MAIN_LEVEL].mean()
        # with both roots at the origin, like the intervals
        if truth is not None:
            off = truth.skeleton.joints(truth.poses[k]) - skeleton.joints(frame.pose)
            inside.append(np.linalg.norm(off, axis=1)[1:] <= radii)
    if swapped is None:
        swapped_known = None
    else:
        swapped_known = mean_known(swapped[sides == 0.0])
    measures = {
        "coverage": _by_level(inside),
        "interval_mm": _by_level(radii_mm),
        "swapped_known_rate": swapped_known,
    }
    return {"unknown_sides": sides, "lost": lost, "interval_mm": radius_mm}, measures


def _by_level(frames: Sequence[NDArray[Any]]) -> dict[str, float] | None:
    """Return the mean at each level of the values (levels, joints) of frames.

    The keys are the levels in percent. The result is None without frames.
    """
    if not frames:
        return None
    means = np.mean(frames, axis=(0, 2))  # (levels,)
    by_level = {}
    for level, mean in zip(LEVELS, means.tolist(), strict=True):
        by_level[f"{100 * level:.0f}"] = mean
    return by_level


def _steadiness(scene: Scene, frames: Sequence[Frame]) -> dict[str, Any]:
    """Return the figures of acceleration and of sliding feet."""
    joints = scene.motion(frames).joints
    fps = scene.fps
    mean = mean_known(acceleration(joints, fps))
    # a person who dances accelerates more than one who walks: the ratio allows for it
    ratio = None
    reference = joints  # the joints that decide whether a foot is on the ground
    if scene.truth is not None:
        reference = scene.truth.joints
        true_mean = mean_known(acceleration(reference, fps))
        if mean is not None and true_mean:
            ratio = mean / true_mean
    slid = slides(joints, standing(reference, fps))
    return {
        "acceleration": mean,
        "acceleration_ratio": ratio,
        "foot_slide_mm": 1e3 * float(slid.mean()) if len(slid) else None,
    }


def mean_known(values: Array) -> float | None:
    """Return the mean of the finite values (T,), or None if there are none."""
    known = values[np.isfinite(values)]
    if len(known):
        return float(known.mean())
    return None


def nearest(
    scene: Scene, training: Array, k: int, observation: Observation, beta: float = BETA
) -> Array:
    """Return the training pose with the lowest cost in a frame.

    With more than 8,000 training poses, every fourth is first compared in a picture a
    quarter as large. Only the best 200 of these and their neighbours in the clips are
    then compared at full size. This takes a fifth of the time, and the result is the
    same except for rare ties.

    Args:
        scene: A scene with a known truth.
        training: The joint angles of training poses (n, 63).
        k: The frame's number.
        observation: The frame's silhouettes.
        beta: The weight in the cost of a pose.

    Returns:
        The pose (66,), with the true root.
    """
    assert scene.truth is not None
    if len(training) > MAX_FULL_SIZE_POSES:
        side = min(min(camera.width, camera.height) for camera in scene.cameras)
        factor = int(np.clip(side // MIN_SMALL_SIDE, 1, MAX_SMALL_FACTOR))
        costs = _costs(scene, training[::SMALL_STRIDE], k, observation, beta, factor)
        first = SMALL_STRIDE * np.argsort(costs, kind="stable")[:FULL_SIZE_CANDIDATES]
        neighbours = first[:, None] + np.arange(1 - SMALL_STRIDE, SMALL_STRIDE)
        rows = np.unique(np.clip(neighbours, 0, len(training) - 1))
        training = training[rows]
    best = training[_costs(scene, training, k, observation, beta).argmin()]
    return np.concatenate([scene.truth.poses[k, :3], best])


def _costs(
    scene: Scene,
    training: Array,
    k: int,
    observation: Observation,
    beta: float,
    factor: int = 1,
) -> Array:
    """Return the costs (n,) of joint angles (n, 63) in frame k.

    They are computed in pictures whose sides are `factor` times smaller.
    """
    assert scene.truth is not None
    roots = np.tile(scene.truth.poses[k, :3], (len(training), 1))
    poses = np.column_stack([roots, training])
    translations = np.tile(scene.truth.translations[k], (len(poses), 1))
    cameras = scene.cameras
    silhouettes = observation.silhouettes
    if factor > 1:
        cameras = [coarser_camera(camera, factor) for camera in cameras]
        silhouettes = [coarser_silhouette(each, factor) for each in silhouettes]
    return pose_costs(scene.body, cameras, silhouettes, poses, translations, beta)[0]


def anytime_trace(frames: Sequence[Frame]) -> dict[str, list[float]]:
    """Return the mean anytime trace of a track's frames.

    A frame with fewer evaluations keeps its last cost. Frames without a search do not
    count.

    Args:
        frames: The tracked frames.

    Returns:
        At most 64 points: `evaluations` of a frame, rising, and the mean best `cost`
        after each.
    """
    # a held frame has no trace, because it was not searched
    searched = [frame.trace for frame in frames if len(frame.trace)]
    if not searched:
        return {"evaluations": [], "cost": []}
    points = np.unique(np.concatenate([trace[:, 0] for trace in searched]))
    # begin where every frame has a cost
    points = points[points >= max(trace[0, 0] for trace in searched)]
    # a long search improves less and less often, so points are spaced by ratio
    if len(points) > MAX_TRACE_POINTS:
        wanted = np.geomspace(points[0], points[-1], MAX_TRACE_POINTS)
        points = np.unique(points[np.searchsorted(points, wanted * (1.0 - 1e-12))])
    costs = []
    for trace in searched:
        # the last improvement at or before each point
        rows = np.searchsorted(trace[:, 0], points, side="right") - 1
        costs.append(trace[rows, 1])
    mean = np.mean(costs, axis=0)  # (points,)
    return {
        "evaluations": points.astype(np.int64).tolist(),
        "cost": [float(f"{cost:.6g}") for cost in mean],
    }


def mode_reliability(
    frames: Sequence[Frame], truth: Array, skeleton: Skeleton
) -> list[list[float]]:
    """Return how often the likeliest mode of a frame is right.

    Args:
        frames: The tracked frames.
        truth: The true joints (T, 27, 3) in metres.
        skeleton: The skeleton of the frames' poses.

    Returns:
        For each bin of the likeliest mode's probability: the number of frames, the mean
        probability, and the share of frames whose mode is right.
    """
    probabilities = []
    right = []
    for frame, joints in zip(frames, truth, strict=True):
        if frame.modes:
            probabilities.append(max(mode.weight for mode in frame.modes))
            right.append(likeliest_is_right(skeleton, frame.modes, joints))
    rows = []
    for count, mean, share in reliability(np.array(probabilities), np.array(right)):
        rows.append([count, round(mean, 6), round(share, 6)])
    return rows
