"""What a track is worth: its errors, beside baselines that anybody can reach."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.prior import Prior
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.motion.steadiness import acceleration, slides, standing
from posefit.silhouette.cost import BETA, areas, mismatch
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette
from posefit.tracking.measures import Measures, Spread
from posefit.uncertainty.calibration import LEVELS
from posefit.uncertainty.intervals import joint_intervals
from posefit.uncertainty.sides import unknown_sides

MANY = 8_000  # training poses, more than which are not all drawn at full size in every frame
STRIDE = 4  # of so many poses each is looked at in a small picture
CLOSE = 200  # of these are looked at closely, with their neighbours in the clip
SMALL = 60  # pixels that a side of a small picture has at least
FACTOR = 4  # by how much it is smaller at most
LOST = 0.5  # how likely a frame has to be lost, for it to be called so


def unseen(rows: Sequence[Mapping[str, float]]) -> set[int]:
    """Return the numbers of the frames that were held or are called lost, which no table tells a place of."""
    return {k for k, row in enumerate(rows) if not row["usable"] or row["lost"] >= LOST}


def nearest(scene: Scene, training: Array, k: int, observation: Observation, beta: float = BETA) -> Array:
    """Return the pose (66,) of least cost in frame k of joint angles (n, 63), with the true root and translation.

    Of more than 8,000 only those are drawn at full size that lie, in their clips, beside the 200 that fit best of
    every fourth in a picture a quarter as large: a fifth of the time, and the same pose but for rare ties.
    """
    if len(training) <= MANY:
        return _best(scene, training, k, observation, beta)
    sides = [side for camera in scene.cameras for side in (camera.width, camera.height)]
    factor = int(np.clip(min(sides) // SMALL, 1, FACTOR))
    costs = _costs(scene, training[::STRIDE], k, observation, beta, factor)
    first = STRIDE * np.argsort(costs, kind="stable")[:CLOSE]
    rows = np.unique(np.clip(first[:, None] + np.arange(1 - STRIDE, STRIDE), 0, len(training) - 1))
    return _best(scene, training[rows], k, observation, beta)


def _best(scene: Scene, training: Array, k: int, observation: Observation, beta: float) -> Array:
    assert scene.truth is not None
    best = training[_costs(scene, training, k, observation, beta).argmin()]
    return np.concatenate([scene.truth.poses[k, :3], best])


def _costs(scene: Scene, training: Array, k: int, observation: Observation, beta: float, factor: int = 1) -> Array:
    """Return the cost (n,) in frame k of joint angles (n, 63), in pictures `factor` times smaller."""
    assert scene.truth is not None
    poses = np.column_stack([np.tile(scene.truth.poses[k, :3], (len(training), 1)), training])
    translations = np.tile(scene.truth.translations[k], (len(poses), 1))
    costs = np.zeros(len(poses))
    for camera, silhouette in zip(scene.cameras, observation.silhouettes, strict=True):
        if factor > 1:
            camera, silhouette = coarser_camera(camera, factor), coarser_silhouette(silhouette, factor)
        costs += mismatch(areas(scene.body, camera, silhouette, poses, translations), beta)
    return costs


def _by_level(frames: Sequence[NDArray[Any]]) -> dict[str, float] | None:
    """Return the mean at each level of values (levels, joints) of frames, by the level's name; None where none has."""
    means = np.mean(frames, axis=(0, 2)) if frames else np.empty(0)
    return {f"{100 * LEVELS[k]:.0f}": float(mean) for k, mean in enumerate(means)} or None


def _mean(values: Array) -> float | None:
    """Return the mean of what is known of values (T,); None where nothing is."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None


class Evaluation:
    """Collects a row a frame. Baselines have the true root and translation, which a tracker has not.

    They are `mean_pose`, the mean of the training poses; `persistence`, the true pose of the first frame, held;
    `nearest`, the training pose of least cost in each frame. `prior_floor` is the truth's own projection into the
    prior, which is no floor where a prior is not linear.
    """

    def __init__(self, scene: Scene, prior: Prior | None, training: Array, beta: float) -> None:
        self._scene, self._prior, self._training, self._beta = scene, prior, training, beta
        self._frames: list[Frame] = []
        self._usable: list[bool] = []
        self._ious: list[float] = []
        self._nearest: list[Array] = []

    def add(self, frame: Frame, observation: Observation) -> dict[str, float]:
        """Return cost, IoU and, where there is a truth, the error of a frame."""
        k = len(self._frames)
        self._frames.append(frame)
        self._usable.append(observation.usable)
        known = [silhouette.known for silhouette in observation.silhouettes]  # by a camera that saw something
        self._ious.append(float(metrics.iou(frame.areas)[known if any(known) else slice(None)].mean()))
        row = {"cost": frame.cost, "iou": self._ious[-1]}
        if self._scene.truth is not None:
            truth = self._scene.truth.poses[k]
            row["error_degrees"] = float(metrics.pose_error_degrees(truth[None], frame.pose[None])[0])
            self._nearest.append(nearest(self._scene, self._training, k, observation, self._beta))
        return row

    def close(self) -> tuple[list[dict[str, float]], Measures]:
        """Return a row for each frame, as `measures.FRAME` names its columns, and what the whole track is worth."""
        frames = self._frames
        columns: dict[str, Array] = {
            "cost": np.array([frame.cost for frame in frames]),
            "iou": np.array(self._ious),
            "usable": np.array(self._usable, dtype=np.float64),
        }
        usable = np.array(self._usable) if any(self._usable) else np.ones(len(frames), dtype=bool)
        errors: dict[str, Any] = {}
        if self._scene.truth is not None:
            per_frame, errors = self._errors()
            columns |= per_frame
        doubts, doubt_measures = self._doubts(columns.get("swapped"))
        columns |= doubts
        used, seconds = sum(frame.evaluations for frame in frames), sum(frame.seconds for frame in frames)
        spent = [frame.cpu_seconds for frame in frames if frame.cpu_seconds is not None]
        measures = Measures(
            **errors,
            **doubt_measures,
            **self._steadiness(),
            iou=float(columns["iou"][usable].mean()),
            cost=float(columns["cost"][usable].mean()),
            held_frames=int(np.count_nonzero(~np.array(self._usable))),
            seconds_per_frame=seconds / len(frames),
            cpu_seconds_per_frame=sum(spent) / len(spent) if spent else None,
            evaluations=used,
            evaluations_per_second=used / max(seconds, 1e-9),  # a plugin may report 0
        )
        columns["evaluations"] = np.array([frame.evaluations for frame in frames])
        columns["seconds"] = np.array([frame.seconds for frame in frames])
        rows = [{"frame": k, **{name: float(v[k]) for name, v in columns.items()}} for k in range(len(frames))]
        return rows, measures

    def _doubts(self, swapped: Array | None) -> tuple[dict[str, Array], dict[str, Any]]:
        """Return the columns and the measures of how certain the method is; NaN in frames where that is unknown."""
        skeleton, truth = self._scene.body.skeleton, self._scene.truth
        sides, lost = np.full((2, len(self._frames)), np.nan)
        inside: list[NDArray[np.bool_]] = []
        wide: list[Array] = []
        for k, frame in enumerate(self._frames):
            lost[k] = np.nan if frame.lost is None else frame.lost
            if frame.posterior is None:
                continue
            sides[k] = unknown_sides(skeleton, frame.posterior, frame.pose)
            within = joint_intervals(skeleton, frame.posterior, frame.pose).radii[:, 1:]
            wide.append(within)
            if truth is not None:
                off = truth.skeleton.joints(truth.poses[k]) - skeleton.joints(frame.pose)
                inside.append(np.linalg.norm(off, axis=1)[1:] <= within)
        asked, judged = np.isfinite(sides), np.isfinite(lost)
        known = asked & (sides == 0.0)
        measures = {
            "coverage": _by_level(inside),
            "interval_mm": _by_level([1e3 * one for one in wide]),
            "unknown_rate": float(sides[asked].mean()) if asked.any() else None,
            "swapped_known_rate": float(swapped[known].mean()) if swapped is not None and known.any() else None,
            "lost_said_rate": float((lost[judged] >= LOST).mean()) if judged.any() else None,
        }
        return {"unknown_sides": sides, "lost": lost}, measures

    def _steadiness(self) -> dict[str, Any]:
        """Return the measures of how joints accelerate and standing feet slide."""
        poses = np.array([frame.pose for frame in self._frames])
        places = np.array([frame.translation for frame in self._frames])
        joints, fps = self._scene.body.skeleton.joints(poses, places), self._scene.fps
        mean, ratio, stands = _mean(acceleration(joints, fps)), None, standing(joints, fps)
        if self._scene.truth is not None:
            truth = self._scene.truth.frames(0, len(self._frames))
            true_joints = truth.skeleton.joints(truth.poses, truth.translations)
            true, stands = _mean(acceleration(true_joints, fps)), standing(true_joints, fps)
            ratio = mean / true if mean is not None and true else None
        slid = slides(joints, stands)
        return {
            "acceleration": mean,
            "acceleration_ratio": ratio,
            "foot_slide_mm": 1e3 * float(slid.mean()) if len(slid) else None,
        }

    def _errors(self) -> tuple[dict[str, Array], dict[str, Any]]:
        """Return the columns and the measures that need a truth."""
        assert self._scene.truth is not None
        truth = self._scene.truth.poses[: len(self._frames)]
        places = self._scene.truth.translations[: len(self._frames)]
        poses = np.array([frame.pose for frame in self._frames])
        skeleton = self._scene.body.skeleton
        true_joints = self._scene.truth.skeleton.joints(truth, places)  # the given body may be another
        joints = skeleton.joints(poses, np.array([frame.translation for frame in self._frames]))
        errors = metrics.pose_error_degrees(truth, poses)
        mpjpe = metrics.mpjpe_mm(true_joints, joints)
        aligned, geodesic = metrics.pa_mpjpe_mm(true_joints, joints), metrics.geodesic_degrees(truth, poses)
        swapped = metrics.swapped(true_joints, joints)
        trivial = dict(self._baselines(truth))
        baselines = {name: float(metrics.pose_error_degrees(truth, pose).mean()) for name, pose in trivial.items()}
        floor = baselines.pop("prior_floor", None)
        distances = {
            name: float(metrics.mpjpe_mm(true_joints, skeleton.joints(trivial[name], places)).mean())
            for name in baselines
        }
        measures = {
            "error_degrees": Spread(
                float(metrics.mean_error(errors)), float(metrics.error_spread(errors)), float(errors.max())
            ),
            "geodesic_degrees": float(geodesic.mean()),
            "free_error_degrees": float(metrics.pose_error_degrees(truth, poses, skeleton.free).mean()),
            "mpjpe_mm": float(mpjpe.mean()),
            "pa_mpjpe_mm": float(aligned.mean()),
            "swap_rate": float(swapped.mean()),
            "lost_rate": float(metrics.lost_rate(mpjpe)),
            "skill": {name: metrics.skill(float(errors.mean()), error) for name, error in baselines.items()},
            "baselines_degrees": baselines,
            "baselines_mm": distances,
            "prior_floor_degrees": floor,
        }
        columns = {
            "error_degrees": errors,
            "geodesic_degrees": geodesic,
            "mpjpe_mm": mpjpe,
            "pa_mpjpe_mm": aligned,
            "swapped": swapped.astype(np.float64),
        }
        return columns, measures

    def _baselines(self, truth: Array) -> list[tuple[str, Array]]:
        def with_root(angles: Array) -> Array:
            return np.column_stack([truth[:, :3], np.broadcast_to(angles, (len(truth), truth.shape[1] - 3))])

        baselines = [
            ("mean_pose", with_root(self._training.mean(axis=0))),
            ("persistence", np.tile(truth[0], (len(truth), 1))),
            ("nearest", np.array(self._nearest)),
        ]
        if self._prior is not None:
            floor = self._prior.inverse_transform(self._prior.transform(truth[:, 3:]))
            baselines.append(("prior_floor", with_root(floor)))
        return baselines
