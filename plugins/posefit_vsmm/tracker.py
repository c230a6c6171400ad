"""The variable-structure multiple-model tracker: its settings, a first pose from one frame, and each frame."""

import inspect
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.problem import align
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.silhouette.cost import known_views, pose_costs
from posefit_vsmm.imm import Belief, Measurement
from posefit_vsmm.joints import JointFilter, lines_of
from posefit_vsmm.kernels import minus, plus
from posefit_vsmm.measurement import Figure, JointCameras, JointMeasurement
from posefit_vsmm.motion import STIFF, library, turned
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import AT, ERROR, Reliance, bone_errors, decode, encode, free_errors
from posefit_vsmm.switching import Models, most_probable, read_topology

if TYPE_CHECKING:
    from posefit_vsmm.joined import Search

NEAR = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])  # yaws that are tried where one is about known
ALL_AROUND = np.linspace(-np.pi, np.pi, 12, endpoint=False)
SHARE = 0.6  # of the budget: what the typical poses may have
ROUND = 40  # draws around the best so far
TYPICAL_DEVIATION = np.radians(15.0)  # from a typical pose: a quaternion that far off costs 1 per cent
SPREADS = np.radians([20.0, 12.0, 7.0, 4.0])  # of the draws, one a round, the last one for the rest


def matched(task: Task, observation: Observation, reliance: Reliance, states: Array) -> tuple[Array, Array]:
    """Return the costs (n,) of states (n, 43) in an observation, and the states, moved to where they fit it."""
    poses, places = decode(states, reliance)
    scene = task.body, task.cameras, observation.silhouettes
    if observation.translation is not None:
        places[:] = observation.translation
    else:
        places = align(*scene, poses, places)
    return pose_costs(*scene, poses, places, threads=task.threads)[0], np.column_stack([places, states[:, 3:]])


MAX_BLIND_FRAMES = 15  # frames that the models go on alone without a visible person; then the track is lost
LOST = 0.35  # IoU: below it, for so many frames, the track is lost
LOST_FRAMES = 8
UNSURE = np.repeat([0.05, np.radians(15.0)], [3, ERROR - 3])  # metres and radians: deviations of a fresh estimation
MISSING_FRAMES = 2  # after these a limb that is not detected, while an end point is unassigned, is sought all around
MISSING_SPREAD = np.radians(15.0)  # deviation that each of its joints then gains a frame
# the bones whose turns a limb's end depends on
_LIMBS = {
    "left hand": ("lhumerus", "lradius"),
    "right hand": ("rhumerus", "rradius"),
    "left foot": ("lfemur", "ltibia"),
    "right foot": ("rfemur", "rtibia"),
}


@final
class TrackFilter:
    """One track, as far as it has come; with a `searcher`, every frame ends in a search."""

    def __init__(self, tracker: "VSMM", rng: np.random.Generator) -> None:
        task, self._how = tracker.task, tracker.how
        self._task, self._reliance, self._rng, self._searcher = task, tracker.library.reliance, rng, tracker.search
        self._models = Models(tracker.how, tracker.library, tracker.topology, task.body.skeleton, task.fps)
        self._cameras = JointCameras(task.body, task.cameras, Figure(task.body.skeleton, self._reliance), tracker.how)
        self._free = np.maximum(free_errors(task.body.skeleton), STIFF)
        self._latest: Frame | None = task.before[-1] if task.before else None
        self._shown: list[JointFilter] = []
        self._belief: Belief | None = None
        self._unseen = self._bad = 0
        self._missing = dict.fromkeys(_LIMBS, 0)

    def frame(self, observation: Observation) -> Frame:
        """Return the next frame."""
        began, models = time.perf_counter(), self._models
        self._begun = time.process_time()
        blind = not observation.usable
        lines = [None if blind else lines_of(silhouette.mask) for silhouette in observation.silhouettes]
        blind = all(one is None for one in lines)
        self._unseen = self._unseen + 1 if blind else 0
        if self._how.recovery and (self._bad >= LOST_FRAMES or self._unseen > MAX_BLIND_FRAMES):
            self._belief = None
        if self._belief is None and blind:
            return self._held(observation, began)
        spent = self._begin(observation) if self._belief is None else 0
        belief = self._belief
        assert belief is not None
        state, spread = models.fused(belief)
        likely = models.known[models.active[int(belief.probabilities.argmax())]]
        expected, spread = likely.predict(state, spread)
        measured = self._cameras.detect(lines, expected, spread, observation.landmarks)
        if self._how.recovery and (extra := self._missing_spread(measured)).any():
            belief = models.widened(belief, extra)
            measured = self._cameras.detect(lines, expected, spread + np.diag(extra), observation.landmarks)
        details = {**self._joints(measured), "detection_seconds": time.perf_counter() - began}
        if self._how.hidden == "imputed":
            measured = [joints.imputed(points) for joints, points in zip(measured, details["joints"], strict=True)]
        filtering, used = time.perf_counter(), spent

        def measure(one: Array) -> Measurement:
            nonlocal used
            measurement = self._cameras.measure(one, measured, observation.translation)
            if self._searcher is None or blind:
                return measurement
            used += 1
            return replace(measurement, log_likelihood=self._searcher.likelihood(one, observation))

        if self._how.angles == "detected":
            models.record(details["joints"][0])
        surprise = float(np.mean([one.surprise for one in measured if one.surprise is not None] or [0.0]))
        self._belief = models.cycle(belief, measure, surprise)
        state, spread = models.fused(self._belief)
        details["filter_seconds"] = time.perf_counter() - filtering
        poses, places = decode(state[None], self._reliance)
        pose, place = poses[0], places[0]
        if self._searcher is not None and not blind:
            budget = self._task.evaluations - used - 1
            result = self._searcher.find(state, spread, observation, budget, self._rng)
            if result is not None:
                pose, evaluations, search_measure = result
                used += evaluations
                self._belief = models.imm.updated(self._belief, search_measure)
                place = models.fused(self._belief)[0][:3]  # one frame alone hardly shows the depth
        if self._how.angles == "state":
            models.record(self._cameras.figure.project(self._task.cameras[0], models.fused(self._belief)[0])[0])
        details |= {"surprise": surprise, **self._model_details()}
        return self._frame(pose, place, observation, used + 1, began, details)

    def _begin(self, observation: Observation) -> int:
        """Take the state (43,) that fits this frame best, with all models equally probable; return its evaluations.

        Typical poses of the models are tried at several yaws, and then draws around the best so far.
        """
        task, latest, rng = self._task, self._latest, self._rng
        yaw, anchor, given = task.yaw, task.anchor, None
        if latest is not None:
            yaw, anchor, given = float(latest.pose[0]), latest.translation, latest.pose
        elif task.first_pose is not None:
            given = np.concatenate([[yaw or 0.0, 0.0, 0.0], task.first_pose])
        budget = task.evaluations - 1 if self._searcher is None else task.evaluations // 2
        yaws = ALL_AROUND if yaw is None else yaw + NEAR
        typical = np.concatenate([model.poses for model in self._models.known.values()])
        turns = [(float(np.cos(0.5 * one)), float(np.sin(0.5 * one))) for one in yaws]
        states = np.array([[*anchor, *turned(pose[:4], *turn), *pose[4:]] for turn in turns for pose in typical])
        room = max(1, min(len(states), int(SHARE * budget)) - (given is not None))
        states = states[np.linspace(0, len(states) - 1, room).astype(np.int64)]
        if given is not None:
            states = np.concatenate([encode(given[None], np.asarray(anchor)[None]), states])
        costs, states = matched(task, observation, self._reliance, states)
        best, least = states[costs.argmin()], float(costs.min())
        home, used = best, len(states)
        free = free_errors(task.body.skeleton)
        for turn in range((budget - used) // ROUND):
            errors = rng.normal(0.0, SPREADS[min(turn, len(SPREADS) - 1)], (ROUND, ERROR))
            errors[:, :3] = 0.0
            errors *= free
            drawn = np.array([plus(best, error) for error in errors])
            costs, states = matched(task, observation, self._reliance, drawn)
            costs += [((minus(state, home)[3:] / TYPICAL_DEVIATION) ** 2).sum() for state in states]
            if costs.min() < least:
                best, least = states[costs.argmin()], float(costs.min())
            used += ROUND
        self._models.restart()
        self._belief = self._models.start(best, self._how.initial_noise * np.diag((UNSURE * self._free) ** 2))
        self._bad = 0
        self._missing = dict.fromkeys(_LIMBS, 0)
        return used

    def _missing_spread(self, measured: Sequence[JointMeasurement]) -> Array:
        """Return the variances (33,) to add for limbs whose ends are not detected while an end point is unassigned."""
        extra = np.zeros(ERROR)
        unassigned = any(one.unassigned for one in measured)
        for limb, bones in _LIMBS.items():
            detected = any(one.confidence[AT[limb]] > 0.0 for one in measured)
            self._missing[limb] = self._missing[limb] + 1 if unassigned and not detected else 0
            if self._missing[limb] >= MISSING_FRAMES:
                for bone in bones:
                    extra[bone_errors(bone)] = MISSING_SPREAD**2
        return np.asarray(extra * self._free**2)

    def _joints(self, measured: Sequence[JointMeasurement]) -> dict[str, Any]:
        """Return the joints (views, 17, 2), predicted where hidden, and the rules' confidence in them (views, 17)."""
        self._shown = self._shown or [JointFilter(one.points) for one in measured]
        points = [
            one.imputed(shown.follow(one.points, one.confidence, one.variances)).points
            for one, shown in zip(measured, self._shown, strict=True)
        ]
        return {"joints": np.array(points), "confidence": np.array([one.confidence for one in measured])}

    def _model_details(self) -> dict[str, Any]:
        """Return the details of a frame that are about the models."""
        belief, models = self._belief, self._models
        details = {name: getattr(models, name) for name in ("group", "newcomer", "groups", "restarts")}
        details |= {"lost": belief is None, "models": models.active}
        if belief is not None:
            details |= {"probabilities": belief.probabilities, "repairs": belief.repairs}
        return details

    def _held(self, observation: Observation, began: float) -> Frame:
        """Return the latest pose once more, or an upright one, while no person is visible."""
        pose, place = np.zeros(66), np.array(self._task.anchor, dtype=np.float64)
        pose[0] = self._task.yaw or 0.0
        if self._latest is not None:
            pose, place = self._latest.pose, self._latest.translation
        return self._frame(pose, place, observation, 0, began, self._model_details())

    def _frame(
        self, pose: Array, place: Array, observation: Observation, used: int, began: float, details: dict[str, Any]
    ) -> Frame:
        task = self._task
        if observation.translation is not None:
            place = np.array(observation.translation, dtype=np.float64)
        pose = np.where(task.body.skeleton.free, pose, 0.0)
        costs, counts = pose_costs(task.body, task.cameras, observation.silhouettes, pose[None], place[None])
        cost, counts = float(costs[0]), counts[:, 0]
        if not self._unseen:
            iou = metrics.iou(np.array(known_views(list(counts), observation.silhouettes))).mean()
            self._bad = self._bad + 1 if iou < LOST else 0
        seconds = time.perf_counter() - began
        spent = time.process_time() - self._begun
        belief, activities, active = self._belief, self._models.topology.activities, self._models.active
        activity = None if belief is None else most_probable(activities, active, belief.probabilities)
        figures = pose, place, cost, counts, used, seconds, np.array([cost])
        self._latest = Frame(*figures, details=details, cpu_seconds=spent, activity=activity)
        return self._latest


class VSMM:
    """Follows a person by the joints that rules find in a silhouette, with the motion models of one group at a time.

    With a `search`, every frame ends in one.
    """

    def __init__(self, task: Task, how: Settings, search: "Search | None" = None) -> None:
        self.task, self.how, self.search = task, how, search
        self.library = library(how.shrink, how.models)
        self.topology = read_topology(Path(how.groups) if how.groups else None, self.library.models)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; its `details` hold models, probabilities, group and joints."""
        filtered = TrackFilter(self, rng)
        for observation in observations:
            yield filtered.frame(observation)


def vsmm(task: Task, **given: Any) -> VSMM:
    """Variable-structure multiple-model filter on detected joints (CN101894278, 2010).

    `vsmm:patent` sets every interpretation to the patent's letter, but for what else is given; defaults differ from it
    where tracks are better.

    Settings:
        variant: the preset, "default" or "patent".
        structure: "variable", one group at a time and two while it changes; "all" models always, a plain IMM.
        groups: path of a TOML file of groups and neighbours; "" is the package's own. Step 4, Interpretation V1.
        quaternions: kept on their "manifold", or mixed and updated as a "vector" of numbers. Interpretation V4.
        shrink: what the models' F is drawn towards, "identity" in normalised units, or "zero". Interpretation V5.
        models: path of a file of models, with another lambda; "" is the package's own. Step 3, Interpretation V5.
        clip_rate: a step goes as far as between frames of the "video", or of the "clip", a quarter of that at 30 a
            second. Interpretation V6.
        joint_errors: of the joint rules, "measured", or "plain": unbiased, the torso's the root's. Interpretation V8.
        process_noise (Q): of the models, as a multiple of their residuals' covariance, above 0. Interpretation V7.
        joint_noise (R): of the detected joints, as a multiple of their variances, above 0. Interpretation V7.
        initial_noise (P0): of the first state, as a multiple of 5 cm and 15 degrees squared, above 0. V7.
        hidden: joints that are not detected are "dropped", or "imputed", as in the patent. Interpretation V9.
        assignment: of end points to hands and feet, "optimal", or each the "nearest". Interpretation V15.
        gates: whether detections far from where they are expected are rejected. Interpretation V15; no in the patent.
        angles: whose changes activate a group, of the projected "state" or of "detected" joints. Interpretation V15.
        hip_angle: that of the thigh to the "trunk" or to the "vertical". Interpretation V15.
        most: of the four lower limbs, 1 or more. Interpretation V15.
        smoothing: frames over which changes of angles are averaged, 1 or more. Interpretation V10; 1 in the patent.
        floor_degrees: a change below it is none, degrees a frame, 0 or more. Interpretation V10; 0 in the patent.
        dwell: frames that a group stays at least, 0 or more. Interpretation V10; 0 in the patent.
        new: how the models of a new group start: "rerun" of the cycle, or the "patent"'s rule. Interpretation V11.
        poses: that the patent's rule starts from, "typical" means or "captured" ones. Interpretation V16.
        test: which group has to go: Wald's "sequential" probability ratio test, or the "patent"'s. Interpretation V12.
        false_alarm (alpha): share of wrong groups that are kept, between 0 and 0.5. Interpretation V12.
        miss (beta): share of right groups that the sequential test drops, between 0 and 0.5. Interpretation V12.
        longest: frames after which the more probable group stays, 1 or more. Interpretation V12.
        restart: whether all models come back where those in force explain nothing. Interpretation V14.
        recovery: whether a lost pose is estimated again and a lost limb sought all around. Interpretation V14.
    """
    return VSMM(task, Settings.of(given))


vsmm.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
    [
        inspect.Parameter("task", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Task),
        *inspect.signature(Settings).parameters.values(),
    ]
)
