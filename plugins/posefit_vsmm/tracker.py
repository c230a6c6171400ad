"""The variable-structure multiple-model tracker: its settings, a first pose from one frame, and each frame."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, NamedTuple, final

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.check import choices, positive
from posefit.fitting.cost import align
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.silhouette.cost import known_views, pose_costs
from posefit_vsmm.groups import TOPOLOGY, most_probable
from posefit_vsmm.imm import Belief, Measurement
from posefit_vsmm.joints import JointFilter, Rules, default_rules, patent_rules
from posefit_vsmm.measurement import JointCameras, JointMeasurement
from posefit_vsmm.motion import CLIP_FPS, STIFF, library
from posefit_vsmm.preprocess import Lines, lines_of
from posefit_vsmm.state import (
    AT,
    BONES,
    ERROR,
    FIRST_BONE,
    decode,
    encode,
    free_errors,
    minus,
    plus,
)
from posefit_vsmm.switching import DefaultForm, Form, PatentForm, Structure, Switching

# The first pose: typical poses at several yaws, then draws around the best so far
YAWS_NEAR = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])  # where the yaw is about known
YAWS_ALL_AROUND = np.linspace(-np.pi, np.pi, 12, endpoint=False)
TYPICAL_SHARE = 0.6  # of the budget: what the typical poses may have
DRAWS = 40  # in a round
# from a typical pose: a quaternion that far off costs 1 per cent
TYPICAL_DEVIATION = np.radians(15.0)
# one a round, the last one for the rest
DRAW_DEVIATIONS = np.radians([20.0, 12.0, 7.0, 4.0])
# metres and radians. Interpretation V7
INITIAL_DEVIATIONS = np.repeat([0.05, np.radians(15.0)], [3, ERROR - 3])

# Interpretation V14
# frames that the models go on alone without a visible person; then the track is lost
MAX_BLIND_FRAMES = 15
LOST_IOU = 0.35  # below it, for so many frames, the track is lost
LOST_FRAMES = 8
# after these a limb that is not detected, while an end point is unassigned, is sought
# all around
MISSING_FRAMES = 2
MISSING_DEVIATION = np.radians(15.0)  # that each of its joints then gains a frame
# bones whose turns a limb's end depends on
_LIMBS = {"hand": ("humerus", "radius"), "foot": ("femur", "tibia")}


class Variant(NamedTuple):
    """What a variant is made of: the letter of the patent, or what tracks better."""

    form: Form  # Interpretations V4 and V11
    rules: Callable[[], Rules]  # Interpretations V8 and V15
    shrunk_to: Literal["identity", "zero"]  # Interpretation V5
    fps: float | None  # of a step of the models; None is the task's. Interpretation V6
    # whether a hidden joint counts as measured where its own filter has it.
    # Interpretation V9
    imputes: bool
    recovers: bool  # Interpretation V14


VARIANTS = {
    "default": Variant(
        DefaultForm(), default_rules, "identity", None, imputes=False, recovers=True
    ),
    "patent": Variant(
        PatentForm(), patent_rules, "zero", CLIP_FPS, imputes=True, recovers=False
    ),
}


@final
class TrackFilter:
    """One track, as far as it has come."""

    def __init__(self, tracker: "VSMM", rng: np.random.Generator) -> None:
        task = tracker.task
        library = tracker.library
        variant = VARIANTS[tracker.variant]
        self._task = task
        self._rng = rng
        models = library.models.fitted_to(
            task.body.skeleton, variant.fps or task.fps, tracker.process_noise
        )
        self.switching = Switching(models, TOPOLOGY, variant.form, tracker.structure)
        self._dependent, self._free = library.dependent, free_errors(task.body.skeleton)
        self._cameras = JointCameras(
            task.body,
            task.cameras,
            self._dependent,
            variant.rules(),
            tracker.joint_noise,
        )
        self._imputes = variant.imputes
        self._recovers = (
            variant.recovers if tracker.recovery is None else tracker.recovery
        )
        self._latest: Frame | None = task.before[-1] if task.before else None
        self._joint_filters: list[JointFilter] = []
        self._belief: Belief | None = None
        self._blind_frames = self._bad_frames = 0

    def frame(self, observation: Observation) -> Frame:
        """Return the next frame."""
        start = time.perf_counter()
        self._evaluations = 0
        usable = observation.usable
        views = [
            lines_of(silhouette.mask) if usable else None
            for silhouette in observation.silhouettes
        ]
        blind = all(lines is None for lines in views)
        self._blind_frames = self._blind_frames + 1 if blind else 0
        if self._recovers and (
            self._bad_frames >= LOST_FRAMES or self._blind_frames > MAX_BLIND_FRAMES
        ):
            self._belief = None
        # the latest pose once more, or an upright one
        if self._belief is None and blind:
            pose = np.append(self._task.yaw or 0.0, np.zeros(65))
            place = self._task.anchor
            if self._latest is not None:
                pose = self._latest.pose
                place = self._latest.translation
            return self._frame(pose, place, observation, {})
        belief, measured, details = self._detected(
            self._belief or self._start(observation), views, observation
        )
        details["detection_seconds"] = time.perf_counter() - start

        def measure(states: Array) -> Measurement:
            return self._cameras.measure(states, measured, observation.translation)

        start = time.perf_counter()
        self._belief = belief = self.switching.cycle(
            belief, measure, details["joints"][0]
        )
        state, _ = self.switching.fused(belief)
        details["filter_seconds"] = time.perf_counter() - start
        (pose,), (place,) = decode(state[None], self._dependent)
        self._evaluations += 1  # that of the frame's own cost
        return self._frame(pose, place, observation, details)

    def _detected(
        self, belief: Belief, views: Sequence[Lines | None], observation: Observation
    ) -> tuple[Belief, list[JointMeasurement], dict[str, Any]]:
        """Return the belief, wider where limbs are sought, what each camera measured, and the joints as details."""
        expected, spread = self.switching.predicted(belief)
        measured = self._cameras.detect(views, expected, spread, observation.landmarks)
        if self._recovers and (extra := self._missing_variances(measured)).any():
            belief = self.switching.widened(belief, extra)
            measured = self._cameras.detect(
                views, expected, spread + np.diag(extra), observation.landmarks
            )
        self._joint_filters = self._joint_filters or [
            JointFilter(view.points) for view in measured
        ]
        imputed = [
            view.imputed(
                joint_filter.follow(view.points, view.confidence, view.variances)
            )
            for view, joint_filter in zip(measured, self._joint_filters, strict=True)
        ]
        joints = [view.points for view in imputed]
        confidence = [view.confidence for view in measured]
        details = {"joints": np.array(joints), "confidence": np.array(confidence)}
        return belief, imputed if self._imputes else measured, details

    def _start(self, observation: Observation) -> Belief:
        """Return the belief in the state (43,) that fits this frame best, with all models equally probable.

        Typical poses of the models are tried at several yaws, and then draws around the best so far.
        """
        task = self._task
        latest = self._latest
        yaw = task.yaw
        anchor = np.asarray(task.anchor)
        known_pose = None
        if latest is not None:
            yaw = float(latest.pose[0])
            anchor = latest.translation
            known_pose = latest.pose
        elif task.first_pose is not None:
            known_pose = np.concatenate([[yaw or 0.0, 0.0, 0.0], task.first_pose])
        budget = task.evaluations - 1
        yaws = YAWS_ALL_AROUND if yaw is None else yaw + YAWS_NEAR
        states = self.switching.models.typical_states(yaws, anchor)
        count = max(
            1, min(len(states), int(TYPICAL_SHARE * budget)) - (known_pose is not None)
        )
        states = states[np.linspace(0, len(states) - 1, count).astype(np.int64)]
        if known_pose is not None:
            states = np.concatenate([encode(known_pose[None], anchor[None]), states])
        costs, states = self._aligned_costs(observation, states)
        best = states[costs.argmin()]
        best_cost = float(costs.min())
        typical = best
        evaluations = len(states)
        for k in range((budget - evaluations) // DRAWS):
            deviation = DRAW_DEVIATIONS[min(k, len(DRAW_DEVIATIONS) - 1)]
            errors = self._free * self._rng.normal(0.0, deviation, (DRAWS, ERROR))
            errors[:, :3] = 0.0
            costs, states = self._aligned_costs(observation, plus(best, errors))
            costs += ((minus(states, typical)[:, 3:] / TYPICAL_DEVIATION) ** 2).sum(
                axis=1
            )
            if costs.min() < best_cost:
                best = states[costs.argmin()]
                best_cost = float(costs.min())
            evaluations += DRAWS
        self.switching.restart()
        deviations = INITIAL_DEVIATIONS * np.maximum(self._free, STIFF)
        self._bad_frames, self._missing = (
            0,
            dict.fromkeys(("left hand", "right hand", "left foot", "right foot"), 0),
        )
        self._evaluations = evaluations
        return self.switching.start(best, np.diag(deviations**2))

    def _aligned_costs(
        self, observation: Observation, states: Array
    ) -> tuple[Array, Array]:
        """Return the costs (n,) of states (n, 43) in an observation, and the states, moved to where they fit it."""
        task = self._task
        known = observation.translation
        poses, places = decode(states, self._dependent)
        scene = task.body, task.cameras, observation.silhouettes
        places = (
            align(*scene, poses, places)
            if known is None
            else np.tile(known, (len(states), 1))
        )
        return pose_costs(*scene, poses, places, threads=task.threads)[
            0
        ], np.column_stack([places, states[:, 3:]])

    def _missing_variances(self, measured: Sequence[JointMeasurement]) -> Array:
        """Return the variances (33,) to add for limbs whose ends are not detected while an end point is unassigned."""
        extra = np.zeros(ERROR)
        unassigned = any(view.unassigned for view in measured)
        for limb, frames in self._missing.items():
            detected = any(view.confidence[AT[limb]] > 0.0 for view in measured)
            self._missing[limb] = frames + 1 if unassigned and not detected else 0
            side, end = limb.split()
            for bone in _LIMBS[end] if self._missing[limb] >= MISSING_FRAMES else ():
                extra[FIRST_BONE:].reshape(-1, 3)[BONES.index(side[0] + bone)] = (
                    MISSING_DEVIATION**2
                )
        return np.asarray(extra * np.maximum(self._free, STIFF) ** 2)

    def _frame(
        self,
        pose: Array,
        place: Array,
        observation: Observation,
        details: Mapping[str, Any],
    ) -> Frame:
        """Return a frame with its cost, the label of its activity, and the models in its details."""
        task = self._task
        belief = self._belief
        switching = self.switching
        if observation.translation is not None:
            place = observation.translation
        pose = np.where(task.body.skeleton.free, pose, 0.0)
        place = np.array(place, dtype=np.float64)
        costs, counts = pose_costs(
            task.body, task.cameras, observation.silhouettes, pose[None], place[None]
        )
        if not self._blind_frames:
            iou = metrics.iou(
                np.array(known_views(list(counts[:, 0]), observation.silhouettes))
            ).mean()
            self._bad_frames = self._bad_frames + 1 if iou < LOST_IOU else 0
        models = {
            name: getattr(switching, name)
            for name in ("group", "candidate_group", "groups")
        }
        models |= {"lost": belief is None, "models": switching.active}
        activity = None
        if belief is not None:
            models |= {"probabilities": belief.probabilities}
            activity = most_probable(
                switching.topology.activities, switching.active, belief.probabilities
            )
        cost = float(costs[0])
        figures = (
            pose,
            place,
            cost,
            counts[:, 0],
            self._evaluations,
            np.array([[self._evaluations, cost]]),
        )
        self._latest = Frame(*figures, details={**details, **models}, activity=activity)
        return self._latest


@dataclass(eq=False)
class VSMM:
    """Variable-structure multiple-model filter on detected joints (CN101894278, 2010).

    `vsmm:patent` sets every interpretation to the patent's letter; the default differs from it where tracks are
    better. The other settings count in both.

    Settings:
        variant: "default", or the "patent"'s letter. Interpretations V4 to V6, V8, V9, V11, V14 and V15.
        structure: "variable", one group at a time and two while it changes; "all" models always, a plain IMM.
        process_noise (Q): of the models, as a multiple of their residuals' covariance, above 0. Interpretation V7.
        joint_noise (R): of the detected joints, as a multiple of their variances, above 0. Interpretation V7.
        recovery: whether a lost pose is estimated again and a lost limb sought all around; by default yes, and no in
            the patent. Interpretation V14.
    """

    task: Task
    _: KW_ONLY
    variant: Literal["default", "patent"] = "default"
    structure: Structure = "variable"
    process_noise: float = 1.0
    joint_noise: float = 1.0
    recovery: bool | None = None

    def __post_init__(self) -> None:
        choices(VSMM, vars(self))
        positive("process_noise", self.process_noise)
        positive("joint_noise", self.joint_noise)
        self.library = library(VARIANTS[self.variant].shrunk_to)

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; its `details` hold models, probabilities, group and joints."""
        track_filter = TrackFilter(self, rng)
        for observation in observations:
            yield track_filter.frame(observation)
