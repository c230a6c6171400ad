"""What a track is worth: its errors beside those of trivial baselines, frame by frame and as a whole.

`FRAME` are the columns of frames.csv: a column is a line there, and its values in `evaluated`.
"""

from collections.abc import Sequence
from typing import Any

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

# `nearest` draws more training poses than these in two rounds: every fourth in a small picture, then the best and
# their neighbours in the clip at full size
MAX_FULL_SIZE_POSES = 8_000
SMALL_STRIDE = 4
FULL_SIZE_CANDIDATES = 200
# pixels of a small picture's side, and by how much it is smaller
MIN_SMALL_SIDE = 60
MAX_SMALL_FACTOR = 4
LOST = 0.5  # a frame is called lost from this probability on
MAX_TRACE_POINTS = 64

FRAME = {
    measure.name: measure
    for measure in (
        Measure("frame", "frame", "", 0, "number of the frame in the footage, from 0"),
        Measure(
            "seconds", "seconds", "s", 2, "time of the frame in the footage, from 0"
        ),
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
            "its radius, the mean over joints; blank where not estimated",
        ),
        MEASURES["evaluations"],
        Measure(
            "wall_seconds",
            "time",
            "ms",
            1,
            "that the estimate took, since that of the frame before",
            1e3,
        ),
        Measure(
            "activity",
            "activity",
            "",
            0,
            "what the person does, a word; blank where not estimated",
        ),
    )
}
# (T,) a column, by the names of `FRAME`; NaN where a value is unknown
Table = dict[str, Array]


def unseen(table: Table) -> set[int]:
    """Return the numbers, as filmed, of frames that were held or are called lost; files leave their places blank."""
    return set(
        table["frame"][(table["usable"] == 0.0) | (table["lost"] >= LOST)].tolist()
    )


def evaluated(
    scene: Scene,
    frames: Sequence[Frame],
    prior: Latents | None,
    training: Array | None,
    beta: float,
    effort: Effort,
) -> tuple[Table, Measures]:
    """Return a column for each figure of a frame, and what the whole track is worth.

    Baselines have the true root and translation, which a tracker has not: `mean_pose`, the mean of the training poses
    (n, 63), which only the errors against a truth need; `persistence`, the true pose of the first frame; `nearest`, the
    training pose of least cost in each frame. `prior_floor_degrees` is the error of the truth projected into the prior,
    which is no floor where a prior is not linear.
    """
    cost = np.array([frame.cost for frame in frames])
    held = np.zeros(len(frames), dtype=bool)
    iou = np.empty(len(frames))  # the mean over the cameras that saw something
    # once: those of a known motion are rendered
    for k, observation in enumerate(scene.observations):
        known = [silhouette.known for silhouette in observation.silhouettes]
        iou[k] = metrics.iou(frames[k].areas)[
            known if any(known) else slice(None)
        ].mean()
        held[k] = not observation.usable
    usable = np.ones(len(frames), dtype=bool) if held.all() else ~held
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
    if scene.truth is None:
        return {}, {}
    assert training is not None
    truth = scene.truth.poses
    places = scene.truth.translations
    skeleton = scene.body.skeleton
    estimate = scene.motion(frames)
    # the given body may be another
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
        return np.column_stack(
            [truth[:, :3], np.broadcast_to(angles, (len(truth), truth.shape[1] - 3))]
        )

    def error_of(poses: Array) -> float:
        return float(metrics.pose_error_degrees(truth, poses).mean())

    trivial = {
        "mean_pose": with_root(training.mean(axis=0)),
        "persistence": np.tile(truth[0], (len(truth), 1)),
        "nearest": np.array(
            [
                nearest(scene, training, k, each, beta)
                for k, each in enumerate(scene.observations)
            ]
        ),
    }
    baselines = {name: error_of(poses) for name, poses in trivial.items()}
    floor = (
        None
        if prior is None
        else error_of(with_root(prior.inverse_transform(prior.transform(truth[:, 3:]))))
    )
    return columns, {
        **{
            name: means[name]
            for name in ("geodesic_degrees", "mpjpe_mm", "pa_mpjpe_mm")
        },
        "error_degrees": Spread(
            metrics.mean_error(errors),
            metrics.error_spread(errors),
            float(errors.max()),
        ),
        "free_error_degrees": float(
            metrics.pose_error_degrees(truth, poses, skeleton.free).mean()
        ),
        "swap_rate": means["swapped"],
        "lost_rate": float(metrics.lost_rate(columns["mpjpe_mm"])),
        "skill": {
            name: metrics.skill(means["error_degrees"], error)
            for name, error in baselines.items()
        },
        "baselines_degrees": baselines,
        "baselines_mm": {
            name: float(
                metrics.mpjpe_mm(true_joints, skeleton.joints(each, places)).mean()
            )
            for name, each in trivial.items()
        },
        "prior_floor_degrees": floor,
    }


def _certainty(
    scene: Scene, frames: Sequence[Frame], swapped: Array | None
) -> tuple[Table, dict[str, Any]]:
    """Return the columns and the measures of how certain the method is; NaN in frames where that is unknown."""
    skeleton = scene.body.skeleton
    truth = scene.truth
    sides, radius_mm = np.full((2, len(frames)), np.nan)
    lost = np.array([np.nan if frame.lost is None else frame.lost for frame in frames])
    inside: list[NDArray[np.bool_]] = []
    radii_mm: list[Array] = []
    for k, frame in enumerate(frames):
        if frame.posterior is None:
            continue
        sides[k] = unknown_sides(skeleton, frame.posterior, frame.pose)
        radii = joint_intervals(skeleton, frame.posterior, frame.pose)[:, 1:]
        radii_mm.append(1e3 * radii)
        radius_mm[k] = radii_mm[-1][MAIN_LEVEL].mean()
        if truth is not None:
            off = truth.skeleton.joints(truth.poses[k]) - skeleton.joints(frame.pose)
            inside.append(np.linalg.norm(off, axis=1)[1:] <= radii)
    measures = {
        "coverage": _by_level(inside),
        "interval_mm": _by_level(radii_mm),
        "unknown_rate": mean_known(sides),
        "swapped_known_rate": None
        if swapped is None
        else mean_known(swapped[sides == 0.0]),
        "lost_flagged_rate": mean_known(
            (lost[np.isfinite(lost)] >= LOST).astype(np.float64)
        ),
    }
    return {"unknown_sides": sides, "lost": lost, "interval_mm": radius_mm}, measures


def _by_level(frames: Sequence[NDArray[Any]]) -> dict[str, float] | None:
    """Return the mean at each level of values (levels, joints) of frames, by the level's name; None where none has."""
    means = np.mean(frames, axis=(0, 2)) if frames else np.empty(0)
    return {
        f"{100 * LEVELS[k]:.0f}": float(mean) for k, mean in enumerate(means)
    } or None


def _steadiness(scene: Scene, frames: Sequence[Frame]) -> dict[str, Any]:
    joints = scene.motion(frames).joints
    fps = scene.fps
    mean = mean_known(acceleration(joints, fps))
    true_joints = None if scene.truth is None else scene.truth.joints
    true_mean = (
        None if true_joints is None else mean_known(acceleration(true_joints, fps))
    )
    slid = slides(joints, standing(joints if true_joints is None else true_joints, fps))
    return {
        "acceleration": mean,
        "acceleration_ratio": mean / true_mean
        if mean is not None and true_mean
        else None,
        "foot_slide_mm": 1e3 * float(slid.mean()) if len(slid) else None,
    }


def mean_known(values: Array) -> float | None:
    """Return the mean of what is known of values (T,); None where nothing is."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None


def nearest(
    scene: Scene, training: Array, k: int, observation: Observation, beta: float = BETA
) -> Array:
    """Return the pose (66,) of least cost in frame k of joint angles (n, 63), with the true root and translation.

    Of more than 8,000 only those are drawn at full size that lie, in their clips, beside the 200 that fit best of
    every fourth in a picture a quarter as large: a fifth of the time, and the same pose but for rare ties.
    """
    assert scene.truth is not None
    if len(training) > MAX_FULL_SIZE_POSES:
        sides = [
            side for camera in scene.cameras for side in (camera.width, camera.height)
        ]
        factor = int(np.clip(min(sides) // MIN_SMALL_SIDE, 1, MAX_SMALL_FACTOR))
        costs = _costs(scene, training[::SMALL_STRIDE], k, observation, beta, factor)
        first = SMALL_STRIDE * np.argsort(costs, kind="stable")[:FULL_SIZE_CANDIDATES]
        rows = np.unique(
            np.clip(
                first[:, None] + np.arange(1 - SMALL_STRIDE, SMALL_STRIDE),
                0,
                len(training) - 1,
            )
        )
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
    """Return the cost (n,) in frame k of joint angles (n, 63), in pictures `factor` times smaller."""
    assert scene.truth is not None
    poses = np.column_stack(
        [np.tile(scene.truth.poses[k, :3], (len(training), 1)), training]
    )
    translations = np.tile(scene.truth.translations[k], (len(poses), 1))
    cameras = scene.cameras
    silhouettes = observation.silhouettes
    if factor > 1:
        cameras = [coarser_camera(camera, factor) for camera in cameras]
        silhouettes = [
            coarser_silhouette(silhouette, factor) for silhouette in silhouettes
        ]
    return pose_costs(scene.body, cameras, silhouettes, poses, translations, beta)[0]


def anytime_trace(frames: Sequence[Frame]) -> dict[str, list[float]]:
    """Return the anytime trace: after so many `evaluations` of a frame, the best `cost`, the mean over the frames.

    A frame that spent fewer keeps its last cost; frames without a search do not count. There are at most 64 points.
    """
    searched = [frame.trace for frame in frames if len(frame.trace)]
    if not searched:
        return {"evaluations": [], "cost": []}
    points = np.unique(np.concatenate([trace[:, 0] for trace in searched]))
    # from where every frame has a cost
    points = points[points >= max(trace[0, 0] for trace in searched)]
    if len(points) > MAX_TRACE_POINTS:
        wanted = np.geomspace(points[0], points[-1], MAX_TRACE_POINTS)
        points = np.unique(points[np.searchsorted(points, wanted * (1.0 - 1e-12))])
    mean = np.mean(
        [
            trace[np.searchsorted(trace[:, 0], points, side="right") - 1, 1]
            for trace in searched
        ],
        axis=0,
    )
    return {
        "evaluations": [int(point) for point in points],
        "cost": [float(f"{cost:.6g}") for cost in mean],
    }


def mode_reliability(
    frames: Sequence[Frame], truth: Array, skeleton: Skeleton
) -> list[list[float]]:
    """Return, by bins of how likely each frame's likeliest mode is: frames, mean probability, how often it is right."""
    weighed = [
        (frame.modes, joints)
        for frame, joints in zip(frames, truth, strict=True)
        if frame.modes
    ]
    right = np.array(
        [likeliest_is_right(skeleton, modes, joints) for modes, joints in weighed]
    )
    likely = np.array([max(mode.weight for mode in modes) for modes, _ in weighed])
    return [
        [count, round(mean, 6), round(share, 6)]
        for count, mean, share in reliability(likely, right)
    ]
