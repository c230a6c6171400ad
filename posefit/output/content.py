"""What the files of a track are made of, and its page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.errors import Table, unseen
from posefit.evaluation.measures import Measures
from posefit.evaluation.trust import Trust
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait
from posefit.motion.motion import Motion
from posefit.uncertainty.calibration import LEVELS, Recalibration
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.shared import depth_halves
from posefit.version import __version__


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What was tracked, and how."""

    motion: str
    source: list[str] | None = None  # one a camera
    frames_chosen: list[int | None] | None = None
    view_degrees: Any = None
    method: str
    settings: Mapping[str, Mapping[str, Any]]
    seed: int
    train: list[str]
    evaluations_per_frame: int
    dimensions: int | None
    translation: str
    first_pose: str
    smooth: bool
    views: int
    camera: str
    size_pixels: tuple[int, int]
    fps: float
    frames: int
    version: str = __version__


@dataclass(frozen=True, kw_only=True)
class TrackingLog:
    """How the track went, and what it leaves open."""

    hypotheses: list[dict[str, Any]]
    build: Mapping[str, Any] | None
    trace: list[list[float]] | None
    modes: list[float] | None
    none_of_modes: float | None
    unknown_sides: list[int] | None
    lost_frames: list[int] | None
    relocalised: list[int]
    retracked_outside: tuple[int, int] | None
    backwards_share: float
    warnings: list[str]
    guesses: list[str]


@dataclass(frozen=True, eq=False)
class Content:
    """What the files of a track are made of."""

    scene: Scene
    frames: Sequence[Frame]
    table: Table
    gait: Gait
    setup: Setup
    measures: Measures
    log: TrackingLog
    trust: Trust | None

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Everything but the frames, as summary.json holds it."""
        trust = None if self.trust is None else asdict(self.trust)
        gait = self.gait.as_dict()
        values = {
            **asdict(self.setup),
            **asdict(self.measures),
            **asdict(self.log),
            "trust": trust,
            "gait": gait,
        }
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values.items()
        }

    @cached_property
    def motion(self) -> Motion:
        """The estimated motion."""
        return self.scene.motion(self.frames)

    @cached_property
    def blank(self) -> set[int]:
        """The frames of which nothing is known: their numbers as filmed."""
        return unseen(self.table)

    @cached_property
    def columns(self) -> dict[str, Any]:
        """The columns (T,) of frames.csv: figures, activity, and joints, unknown ones as NaN."""
        points = self.motion.joints.reshape(len(self.frames), -1).T.copy()  # (81, T)
        points[:, np.isin(self.table["frame"], list(self.blank))] = np.nan
        names = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
        columns: dict[str, Any] = dict(self.table)
        columns["activity"] = [frame.activity for frame in self.frames]
        columns.update(zip(names, points, strict=True))
        return columns

    @cached_property
    def intervals(self) -> dict[str, Array]:
        """How far joints and angles may be off, as poses.npz has it; empty where no frame has a posterior.

        `levels` (3,), `joint_radii` (T, 3, 27) metres about the root, of footage `place_radii` in the world, too, and
        `angle_halves` (T, 3, 66) radians; NaN in frames without any.
        """
        if all(frame.posterior is None for frame in self.frames):
            return {}
        skeleton = self.scene.body.skeleton
        camera = self.scene.cameras[0]
        radii, places = np.full((2, len(self.frames), len(LEVELS), len(JOINTS)), np.nan)
        halves = np.full((len(self.frames), len(LEVELS), ANGLES), np.nan)
        for k, frame in enumerate(self.frames):
            if frame.posterior is not None:
                radii[k], in_world = (
                    joint_intervals(skeleton, frame.posterior, frame.pose, world)
                    for world in (False, True)
                )
                model = frame.posterior.recalibration or Recalibration()
                places[k] = np.hypot(
                    in_world, depth_halves(model, camera, frame.translation)
                )
                halves[k] = angle_intervals(frame.posterior, frame.pose)
        intervals = {
            "levels": np.array(LEVELS),
            "joint_radii": radii,
            "angle_halves": halves,
        }
        return intervals | ({"place_radii": places} if self.scene.truth is None else {})
