"""The tracker `vsmm`: its settings, and how it advances by a frame."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, NamedTuple, final

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.check import choices, positive
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import known_views, pose_costs
from posefit.silhouette.mask import Areas
from posefit_vsmm.first_state import FirstState
from posefit_vsmm.groups import TOPOLOGY, most_probable
from posefit_vsmm.imm import Belief, Measurement
from posefit_vsmm.joints import JointFilter, Rules, default_rules, patent_rules
from posefit_vsmm.measurement import JointCameras, JointMeasurement
from posefit_vsmm.motion import CLIP_FPS, STIFF, library
from posefit_vsmm.preprocess import Lines, lines_of
from posefit_vsmm.state import AT, BONES, ERROR, FIRST_BONE, decode, free_errors
from posefit_vsmm.switching import DefaultForm, Form, PatentForm, Structure, Switching

# metres and radians. Interpretation V7
INITIAL_DEVIATIONS = np.repeat([0.05, np.radians(15.0)], [3, ERROR - 3])

# Interpretation V14
# The models predict this many frames without a visible person; then the track is lost.
MAX_BLIND_FRAMES = 15
# The track is also lost if the IoU is below LOST_IOU for LOST_FRAMES frames.
LOST_IOU = 0.35
LOST_FRAMES = 8
# A limb is missing if it is not detected for this many frames while some end point is
# unassigned. The variance of its joints then grows by MISSING_DEVIATION**2 per frame,
# so that the limb is searched for in a larger area.
MISSING_FRAMES = 2
MISSING_DEVIATION = np.radians(15.0)
LIMBS = ("left hand", "right hand", "left foot", "right foot")
# the bones that move a limb's end
_LIMB_BONES = {"hand": ("humerus", "radius"), "foot": ("femur", "tibia")}


class Variant(NamedTuple):
    """The parts that differ between the default and the patent's letter."""

    form: Form  # Interpretations V4 and V11
    rules: Callable[[], Rules]  # Interpretations V8 and V15
    shrunk_to: Literal["identity", "zero"]  # Interpretation V5
    # frame rate of the models; None for the task's. Interpretation V6
    fps: float | None
    # whether a hidden joint counts as measured at its filter's prediction.
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
class MissingLimbs:
    """Counts for how many frames each limb was not detected."""

    def __init__(self, scales: Array) -> None:
        # (33,) the deviation that each error may have, as a share of a free joint's
        self._scales = scales
        self._frames = dict.fromkeys(LIMBS, 0)

    def restart(self) -> None:
        """Count all limbs as detected."""
        self._frames = dict.fromkeys(LIMBS, 0)

    def variances(self, measured: Sequence[JointMeasurement]) -> Array:
        """Count a frame, and return the variances (33,) to add for missing limbs."""
        extra = np.zeros(ERROR)
        bones = extra[FIRST_BONE:].reshape(-1, 3)  # a view: writing to it fills `extra`
        unassigned = any(view.unassigned for view in measured)
        for limb, frames in self._frames.items():
            if unassigned and not _is_detected(limb, measured):
                self._frames[limb] = frames + 1
            else:
                self._frames[limb] = 0
            if self._frames[limb] < MISSING_FRAMES:
                continue
            side, end = limb.split()
            for bone in _LIMB_BONES[end]:
                bones[BONES.index(side[0] + bone)] = MISSING_DEVIATION**2
        return np.asarray(extra * self._scales**2)


def _is_detected(point: str, measured: Sequence[JointMeasurement]) -> bool:
    """Return whether some camera detected a point."""
    row = AT[point]
    return any(view.confidence[row] > 0.0 for view in measured)


@final
class LossTest:
    """Tests whether a track is lost: its person is hidden, or does not fit, too long.

    Interpretation V14.
    """

    def __init__(self) -> None:
        self._blind_frames = 0
        self._bad_frames = 0

    @property
    def is_lost(self) -> bool:
        """Whether the track is lost."""
        hidden = self._blind_frames > MAX_BLIND_FRAMES
        return hidden or self._bad_frames >= LOST_FRAMES

    def restart(self) -> None:
        """Forget the frames that did not fit: a first state was found again."""
        self._bad_frames = 0

    def add_view(self, blind: bool) -> None:
        """Take whether the person is hidden in the next frame."""
        self._blind_frames = self._blind_frames + 1 if blind else 0

    def add_pose(self, areas: Areas, observation: Observation) -> None:
        """Take the areas (V, 3) of the frame's pose.

        A frame without the person changes nothing.
        """
        if self._blind_frames:
            return
        known = known_views(list(areas), observation.silhouettes)
        bad = metrics.iou(np.array(known)).mean() < LOST_IOU
        self._bad_frames = self._bad_frames + 1 if bad else 0


@final
class TrackFilter:
    """The state of one track, advanced frame by frame."""

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
        self._dependent = library.dependent
        free = free_errors(task.body.skeleton)
        self._scales = np.maximum(free, STIFF)
        self._first_state = FirstState(
            task, self.switching.models, library.dependent, free
        )
        self._missing = MissingLimbs(self._scales)
        self._cameras = JointCameras(
            task.body,
            task.cameras,
            self._dependent,
            variant.rules(),
            tracker.joint_noise,
        )
        self._imputes = variant.imputes
        self._recovers = tracker.recovery
        if tracker.recovery is None:
            self._recovers = variant.recovers
        self._latest: Frame | None = task.before[-1] if task.before else None
        self._joint_filters: list[JointFilter] = []
        self._belief: Belief | None = None  # None before the start, and once lost
        self._loss_test = LossTest()

    def frame(self, observation: Observation) -> Frame:
        """Return the frame of the next observation."""
        start = time.perf_counter()
        views: list[Lines | None] = [None] * len(observation.silhouettes)
        if observation.usable:
            views = [lines_of(view.mask) for view in observation.silhouettes]
        blind = all(lines is None for lines in views)  # the person is hidden
        self._loss_test.add_view(blind)
        if self._recovers and self._loss_test.is_lost:
            self._belief = None
        evaluations = 1  # the cost of the frame itself
        if self._belief is None:
            if blind:
                return self._repeated(observation)
            self._belief, used = self._start(observation)
            evaluations += used
        belief, measured, details = self._detect(self._belief, views, observation)
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
        return self._frame(pose, place, observation, evaluations, details)

    def _repeated(self, observation: Observation) -> Frame:
        """Return the latest pose again, or an upright one before the first.

        It is not a result of the filter, so its cost is not an evaluation.
        """
        if self._latest is not None:
            pose = self._latest.pose
            place = self._latest.translation
        else:
            pose = np.append(self._task.yaw or 0.0, np.zeros(ANGLES - 1))
            place = self._task.anchor
        return self._frame(pose, place, observation, 0, {})

    def _detect(
        self, belief: Belief, views: Sequence[Lines | None], observation: Observation
    ) -> tuple[Belief, list[JointMeasurement], dict[str, Any]]:
        """Detect the joints of a frame.

        Returns:
            The belief, with larger variances for missing limbs; the measurement of each
            camera; and the joints and their confidence as details of the frame.
        """
        expected, spread = self.switching.predicted(belief)
        measured = self._cameras.detect(views, expected, spread, observation.landmarks)
        extra = np.zeros(ERROR)
        if self._recovers:
            extra = self._missing.variances(measured)
        if extra.any():
            belief = self.switching.widened(belief, extra)
            measured = self._cameras.detect(
                views, expected, spread + np.diag(extra), observation.landmarks
            )
        if not self._joint_filters:
            self._joint_filters = [JointFilter(view.points) for view in measured]
        imputed = []
        for view, joint_filter in zip(measured, self._joint_filters, strict=True):
            points = joint_filter.follow(view.points, view.confidence, view.variances)
            imputed.append(view.imputed(points))
        details = {
            "joints": np.array([view.points for view in imputed]),
            "confidence": np.array([view.confidence for view in measured]),
        }
        if self._imputes:
            measured = imputed
        return belief, measured, details

    def _start(self, observation: Observation) -> tuple[Belief, int]:
        """Return the belief in the state that fits this frame best, and evaluations.

        All models are equally probable.
        """
        state, evaluations = self._first_state.estimate(
            observation, self._latest, self._rng
        )
        self.switching.restart()
        self._missing.restart()
        self._loss_test.restart()
        deviations = INITIAL_DEVIATIONS * self._scales
        return self.switching.start(state, np.diag(deviations**2)), evaluations

    def _frame(
        self,
        pose: Array,
        place: Array,
        observation: Observation,
        evaluations: int,
        details: Mapping[str, Any],
    ) -> Frame:
        """Return a frame with its cost, its activity, and the models in its details."""
        task = self._task
        if observation.translation is not None:
            place = observation.translation
        pose = np.where(task.body.skeleton.free, pose, 0.0)
        place = np.array(place, dtype=np.float64)
        costs, counts = pose_costs(
            task.body, task.cameras, observation.silhouettes, pose[None], place[None]
        )
        areas = counts[:, 0]  # (V, 3)
        self._loss_test.add_pose(areas, observation)
        activity, models = self._active_models()
        cost = float(costs[0])
        self._latest = Frame(
            pose=pose,
            translation=place,
            cost=cost,
            areas=areas,
            evaluations=evaluations,
            trace=np.array([[evaluations, cost]]),
            activity=activity,
            details={**details, **models},
        )
        return self._latest

    def _active_models(self) -> tuple[str | None, dict[str, Any]]:
        """Return the activity, None if lost, and the models as details of a frame."""
        belief = self._belief
        switching = self.switching
        models: dict[str, Any] = {
            "group": switching.group,
            "candidate_group": switching.candidate_group,
            "groups": switching.groups,
            "lost": belief is None,
            "models": switching.active,
        }
        if belief is None:
            return None, models
        models["probabilities"] = belief.probabilities
        activity = most_probable(
            switching.topology.activities, switching.active, belief.probabilities
        )
        return activity, models


@dataclass(eq=False)
class VSMM:
    """Variable-structure multiple-model filter on detected joints (CN101894278, 2010).

    `vsmm:patent` sets every interpretation to the patent's letter; the default differs
    where that tracks better. The other settings apply to both.

    Settings:
        variant: "default", or "patent" for the patent's letter. Interpretations V4 to
            V6, V8, V9, V11, V14 and V15.
        structure: "variable" runs one group of models, and two during a switch; "all"
            always runs all models, as a plain IMM does.
        process_noise (Q): Noise of the models, as a multiple of their residuals'
            covariance, above 0. Interpretation V7.
        joint_noise (R): Noise of the detected joints, as a multiple of their variances,
            above 0. Interpretation V7.
        recovery: Whether a lost pose is estimated again and a lost limb is searched for
            in a larger area; by default yes, in the patent no. Interpretation V14.
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
        """Yield a `Frame` for each observation.

        Its `details` contain the models, their probabilities, the group and the joints.
        """
        track_filter = TrackFilter(self, rng)
        for observation in observations:
            yield track_filter.frame(observation)
