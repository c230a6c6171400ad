"""Rules of a tracker: one whole, honest frame per observation, repetition, no leaks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from posefit.fitting import metrics
from posefit.fitting.driving import Audit, drive
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.fitting.validation import BrokenRuleError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA, project
from posefit.silhouette.mask import Silhouette
from posefit.testing import common
from posefit.testing.common import PluginCase, global_random_state, unchanged
from posefit.testing.problem import SIZE
from posefit.testing.results import BrokenError, expect

FRAMES = 12
EVALUATIONS = 800


@lru_cache(maxsize=1)
def scene() -> tuple[Task, Motion, Sequence[Observation]]:
    """Return a task, the true motion and its observations: 12 frames of a walk."""
    motion = built_in.motion("walk", frames=FRAMES)
    body = Body.of(motion.skeleton)
    camera = Camera.around(motion.translations.mean(axis=0), 0.8, 3.5, SIZE)
    observations = []
    for pose, where in zip(motion.poses, motion.translations, strict=True):
        silhouette = Silhouette.of(project(body, camera, pose, where))
        observations.append(Observation([silhouette], where))
    training = [built_in.motion(style) for style in built_in.other_styles("walk")]
    anchor = motion.translations[0]
    return (
        Task(
            body, [camera], EVALUATIONS, 0.0, anchor, fps=motion.fps, training=training
        ),
        motion,
        observations,
    )


class Tracked(NamedTuple):
    """The frames of a tracker, and how it computed them.

    Attributes:
        tracker: The tracker, after its first track.
        frames: One per observation.
        taken: How many observations it had taken when it gave each frame.
        warnings: The warnings of the audit.
        inputs_unchanged: Whether masks and anchor are as before.
        random_unchanged: Whether the global random generators are as before.
    """

    tracker: Tracker
    frames: list[Frame]
    taken: list[int]
    warnings: list[str]
    inputs_unchanged: bool
    random_unchanged: bool


@dataclass(frozen=True)
class Case(PluginCase):
    """A tracker's factory with its settings."""

    arguments = ("task",)

    looks_ahead: bool = False

    def build(self, **more: Any) -> Tracker:
        """Return a new tracker of the scene."""
        tracker: Tracker = self.factory(scene()[0], **{**self.settings, **more})
        return tracker

    def use(self, **more: Any) -> None:
        """Track two frames."""
        list(self.build(**more).track(scene()[2][:2], np.random.default_rng(0)))

    @property
    def random_unchanged(self) -> bool:
        """Whether the first track left the global random generators unchanged."""
        return self.first.random_unchanged

    def use_fully(self) -> bool:
        """Track all frames."""
        return self.same(self.build())

    def same(self, tracker: Tracker) -> bool:
        """Return whether a tracker gives the first track's poses."""
        again = tracker.track(scene()[2], np.random.default_rng(0))
        return np.array_equal(
            [frame.pose for frame in again], [frame.pose for frame in self.first.frames]
        )

    @cached_property
    def first(self) -> Tracked:
        """The audited track of a new tracker.

        All rules share it, because a track may take minutes.
        """
        task, _, observations = scene()
        tracker = self.build()
        audit = Audit("the tracker", BETA)
        frames = list[Frame]()
        taken = list[int]()
        count = 0

        def stream() -> Iterator[Observation]:
            nonlocal count
            for observation in observations:
                count += 1
                yield observation

        masks = [observation.silhouettes[0].mask for observation in observations]
        inputs_unchanged = unchanged(*masks, task.anchor)
        random = global_random_state()
        try:
            rng = np.random.default_rng(0)
            for frame in drive(lambda _task: tracker, audit, task, stream(), rng):
                frames.append(frame)
                taken.append(count)
        except BrokenRuleError as broken:
            raise BrokenError(str(broken)) from broken.__cause__
        random_unchanged = random == global_random_state()
        return Tracked(
            tracker, frames, taken, audit.warnings, inputs_unchanged(), random_unchanged
        )


def one_frame_each(case: Case) -> str:
    """Every observation gives one frame, with all that belongs to a frame."""
    return f"{len(case.first.frames)} frames"


def as_they_come(case: Case) -> None:
    """A frame comes before the observation after the next, unless it looks ahead."""
    for given, taken in enumerate(case.first.taken, 1):
        late = taken > given + 1 and not case.looks_ahead
        expect(
            not late,
            "frames must come as observations do, "
            f"got frame {given} after {taken} of them",
        )


def no_observation(case: Case) -> None:
    """No observation gives no frame."""
    frames = list(case.build().track([], np.random.default_rng(0)))
    expect(not frames, f"no observation must give no frame, got {len(frames)}")


def audit(case: Case) -> str:
    """Cost and areas fit the pose; every pose is counted and the budget is kept."""
    expect(not case.first.warnings, "; ".join(case.first.warnings))
    most = max(frame.evaluations for frame in case.first.frames)
    return f"at most {most} of {EVALUATIONS} evaluations"


def same_seed(case: Case) -> None:
    """The same seed gives the same poses."""
    expect(case.same(case.build()), "one seed must give one track, got two")


def used_twice(case: Case) -> None:
    """A tracker that has tracked before gives the same track again."""
    expect(
        case.same(case.first.tracker),
        "a second track must equal the first, got another",
    )


def inputs(case: Case) -> None:
    """The tracker does not modify observations or task."""
    expect(
        case.first.inputs_unchanged,
        "the tracker must not modify observations or task, but did",
    )


def follows(case: Case) -> str:
    """The track is not lost: its MPJPE is below 150 mm."""
    task, motion, _ = scene()
    poses = np.array([frame.pose for frame in case.first.frames])
    places = np.array([frame.translation for frame in case.first.frames])
    error = metrics.mpjpe_mm(
        motion.joints, task.body.skeleton.joints(poses, places)
    ).mean()
    expect(
        error < metrics.LOST_MM,
        f"the MPJPE must be below {metrics.LOST_MM:g} mm, got {error:.0f}",
    )
    return f"MPJPE {error:.0f} mm"


RULES = [
    common.construction,
    one_frame_each,
    as_they_come,
    no_observation,
    audit,
    same_seed,
    used_twice,
    common.global_randomness,
    inputs,
    follows,
    common.silence,
    common.nonsense_settings,
    common.unknown_setting,
]
