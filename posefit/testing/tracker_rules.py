"""Is a tracker right: a frame for each observation as it comes, whole and honest frames, the same again, no leaks?"""

import copy
import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.fitting.validation import UNCOUNTED_POSES
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import areas, mismatch, project
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import Silhouette
from posefit.testing.problem import SIZE
from posefit.testing.randomness import left_alone, watched
from posefit.testing.results import Checklist, SkippedError, expect

FRAMES = 12
EVALUATIONS = 400
checklist = Checklist()


@lru_cache(maxsize=1)
def scene() -> tuple[Task, Motion, Sequence[Observation]]:
    """Return a task, the true motion, and what is seen of it: twelve frames of the built-in walk."""
    motion = built_in.motion("walk", frames=FRAMES)
    body = Body.of(motion.skeleton)
    camera = Camera.around(motion.translations.mean(axis=0), 0.8, 3.5, SIZE)
    seen = [
        Observation([Silhouette.of(project(body, camera, pose, where))], where)
        for pose, where in zip(motion.poses, motion.translations, strict=True)
    ]
    training = [built_in.motion(style) for style in built_in.other_styles("walk")]
    anchor = motion.translations[0]
    return Task(body, [camera], EVALUATIONS, 0.0, anchor, fps=motion.fps, training=training), motion, seen


@dataclass(frozen=True)
class Tracked:
    """What a tracker found, and how."""

    tracker: Tracker
    frames: list[Frame]
    taken: list[int]  # observations that it had taken when it gave each frame
    drawn: list[float]  # poses that it had drawn
    inputs_kept: bool
    random_kept: bool


@dataclass(frozen=True)
class TrackerCase:
    """A factory with its settings."""

    factory: Callable[..., Any]
    settings: dict[str, Any] = field(default_factory=dict)

    def build(self) -> Tracker:
        """Return a new tracker of the scene."""
        tracker: Tracker = self.factory(scene()[0], **self.settings)
        return tracker

    @cached_property
    def first(self) -> Tracked:
        """What a new tracker finds, which may take its time: once for all rules that can do with it."""
        task, _, seen = scene()
        tracker, drawn, frames = self.build(), PoseCount(), list[Frame]()
        given, taken, poses = list[Observation](), list[int](), list[float]()

        def stream() -> Iterator[Observation]:
            for observation in seen:
                given.append(replace(observation, silhouettes=drawn.own(observation.silhouettes)))
                yield given[-1]

        before = copy.deepcopy([one.silhouettes[0].mask for one in seen]), task.anchor.copy()
        with watched() as random, drawn.counting():
            for frame in tracker.track(stream(), np.random.default_rng(0)):
                frames.append(frame)
                taken.append(len(given))
                poses.append(drawn.poses)
        same = all(np.array_equal(was, one.silhouettes[0].mask) for was, one in zip(before[0], given, strict=False))
        return Tracked(tracker, frames, taken, poses, same and np.array_equal(before[1], task.anchor), random.kept)

    @property
    def frames(self) -> list[Frame]:
        """What it found."""
        return self.first.frames


@checklist
def construction(case: TrackerCase) -> None:
    """A factory takes the task and keyword-only settings."""
    kinds = [one.kind for one in inspect.signature(case.factory).parameters.values()]
    plain = [kind for kind in kinds if kind is not inspect.Parameter.KEYWORD_ONLY]
    expect(len(plain) == 1, f"a factory must take (task) and keyword-only settings, got {len(plain)} others")
    case.build()


@checklist
def one_frame_each(case: TrackerCase) -> str:
    """Every observation gives one frame."""
    count = len(case.frames)
    expect(count == FRAMES, f"{FRAMES} observations must give {FRAMES} frames, got {count}")
    return f"{count} frames"


@checklist
def as_they_come(case: TrackerCase) -> None:
    """A frame is given before the observation after the next is taken; or as much later as the tracker's `lag` says."""
    lag = getattr(case.first.tracker, "lag", 1)
    for given, taken in enumerate(case.first.taken, 1):
        expect(taken <= given + lag, f"frames must come as observations do, got frame {given} after {taken} of them")


@checklist
def no_observation(case: TrackerCase) -> None:
    """No observation gives no frame."""
    found = list(case.build().track([], np.random.default_rng(0)))
    expect(not found, f"no observation must give no frame, got {len(found)}")


@checklist
def whole_frames(case: TrackerCase) -> None:
    """A frame has a pose (66,), a translation (3,) and areas (1, 3), all finite."""
    for frame in case.frames:
        for name, shape in (("pose", (66,)), ("translation", (3,)), ("areas", (1, 3))):
            value = np.asarray(getattr(frame, name))
            expect(value.shape == shape, f"{name} must have shape {shape}, got {value.shape}")
            expect(np.isfinite(value).all(), f"{name} must be finite, got nan or infinity")


@checklist
def honest_cost(case: TrackerCase) -> None:
    """The cost and the areas of a frame are those of its pose."""
    task, _, seen = scene()
    for frame, observation in zip(case.frames, seen, strict=False):
        counted = areas(
            task.body, task.cameras[0], observation.silhouettes[0], frame.pose[None], np.array(frame.translation)[None]
        )
        expect(
            np.array_equal(counted, frame.areas),
            f"areas must be {counted.tolist()}, got {np.asarray(frame.areas).tolist()}",
        )
        cost = float(mismatch(counted)[0])
        expect(abs(cost - frame.cost) < 1e-9, f"cost must be {cost:.6g}, got {frame.cost:.6g}")


@checklist
def budget(case: TrackerCase) -> str:
    """No frame uses more evaluations than the task allows."""
    used = [frame.evaluations for frame in case.frames]
    expect(max(used) <= EVALUATIONS, f"a frame must use at most {EVALUATIONS} evaluations, got {max(used)}")
    return f"{max(used)} of {EVALUATIONS}"


@checklist
def honest_evaluations(case: TrackerCase) -> str:
    """A frame counts every pose that is drawn for it as an evaluation."""
    said = np.cumsum([frame.evaluations for frame in case.frames])
    drawn, least = np.array(case.first.drawn), np.arange(1, len(said) + 1)
    # a frame that looks ahead may have drawn for the next observation already
    ahead = EVALUATIONS * (np.array(case.first.taken) - least)
    over = drawn - said - ahead > UNCOUNTED_POSES * least
    if over.any():
        k = int(over.argmax())
        expect(False, f"{k + 1} frames drew {drawn[k]:.0f} poses, and must say so, got {said[k]} evaluations")
    return f"{drawn[-1]:.0f} poses drawn, {said[-1]} evaluations"


@checklist
def seconds(case: TrackerCase) -> None:
    """A frame says how long it took."""
    for frame in case.frames:
        expect(np.isfinite(frame.seconds) and frame.seconds >= 0.0, f"seconds must be 0 or more, got {frame.seconds}")


def _poses(frames: list[Frame]) -> Any:
    return np.array([frame.pose for frame in frames])


@checklist
def same_seed(case: TrackerCase) -> None:
    """The same seed gives the same poses."""
    again = list(case.build().track(scene()[2], np.random.default_rng(0)))
    expect(np.array_equal(_poses(case.frames), _poses(again)), "one seed must give one track, got two")


@checklist
def used_twice(case: TrackerCase) -> None:
    """A tracker that has tracked before does the same again."""
    again = list(case.first.tracker.track(scene()[2], np.random.default_rng(0)))
    expect(np.array_equal(_poses(case.frames), _poses(again)), "a second track must be as the first, got another")


@checklist
def global_randomness(case: TrackerCase) -> None:
    """The global random generators are left alone."""
    if not case.first.random_kept:  # a library that was imported meanwhile may have seeded them
        with left_alone():
            list(case.build().track(scene()[2], np.random.default_rng(0)))


@checklist
def inputs(case: TrackerCase) -> None:
    """Observations and task stay as they were."""
    expect(case.first.inputs_kept, "observations and task must stay as they are, got others")


@checklist
def follows(case: TrackerCase) -> str:
    """The track is nearer to the truth than a body lying on the floor: its MPJPE is below 400 mm."""
    task, motion, _ = scene()
    frames = case.frames
    if len(frames) != FRAMES:
        raise SkippedError("it did not give a frame for each observation")
    places = np.array([frame.translation for frame in frames])
    skeleton = task.body.skeleton
    error = metrics.mpjpe_mm(
        skeleton.joints(motion.poses, motion.translations), skeleton.joints(_poses(frames), places)
    ).mean()
    expect(error < 400.0, f"the MPJPE must be below 400 mm, got {error:.0f}")
    return f"MPJPE {error:.0f} mm"


@checklist
def unknown_setting(case: TrackerCase) -> None:
    """A setting that does not exist is refused."""
    try:
        case.factory(scene()[0], **case.settings, no_such_setting=1)
    except TypeError:
        return
    expect(False, "an unknown setting must raise TypeError, got a tracker")
