"""The data of a track, from which its files and its page are made."""

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
    """The arguments and the circumstances of a track."""

    motion: str  # the name of the scene
    source: list[str] | None = None  # one per camera
    frames_chosen: list[int | None] | None = (
        None  # start and stop, as the user gave them
    )
    view_degrees: Any = None
    method: str
    settings: Mapping[str, Mapping[str, Any]]
    seed: int
    train: list[str]
    evaluations_per_frame: int
    dimensions: int | None  # coordinates of a proposal; None for a tracker of a plugin
    translation: str
    first_pose: str
    smooth: bool
    views: int  # number of cameras
    camera: str  # where the cameras come from, see `Scene.placing`
    size_pixels: tuple[int, int]  # of the first camera
    fps: float
    frames: int  # number of frames
    version: str = __version__


@dataclass(frozen=True, kw_only=True)
class TrackingLog:
    """The course of a track, and everything that it did not determine."""

    hypotheses: list[dict[str, Any]]  # see `Tracked`
    build: Mapping[str, Any] | None  # None if the build was not fitted
    trace: list[list[float]] | None  # evaluations and best costs of a single frame
    modes: list[float] | None  # the weights of other likely tracks
    none_of_modes: float | None  # the mean probability that no mode is right
    # numbers of frames, as filmed; None if the method does not report them
    unknown_sides: list[int] | None
    lost_frames: list[int] | None
    relocalised: list[int]  # numbers of frames, as filmed
    retracked_outside: tuple[int, int] | None  # the run without spins that was kept
    backwards_share: float  # of the frames
    warnings: list[str]
    guesses: list[str]


@dataclass(frozen=True, eq=False)
class Content:
    """The data of a track, from which its files are made."""

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
        """The content of summary.json: everything except the frames."""
        trust = None if self.trust is None else asdict(self.trust)
        gait = self.gait.as_dict()
        values = {
            **asdict(self.setup),
            **asdict(self.measures),
            **asdict(self.log),
            "trust": trust,
            "gait": gait,
        }
        for name, value in values.items():
            if isinstance(value, tuple):
                values[name] = list(value)
        return values

    @cached_property
    def motion(self) -> Motion:
        """The estimated motion."""
        return self.scene.motion(self.frames)

    @cached_property
    def unseen(self) -> set[int]:
        """The numbers, as filmed, of the frames that show nothing of the person."""
        return unseen(self.table)

    @cached_property
    def columns(self) -> dict[str, Any]:
        """The columns (T,) of frames.csv: figures, activity and joints.

        Unknown joints are NaN.
        """
        points = self.motion.joints.reshape(len(self.frames), -1).T.copy()  # (81, T)
        points[:, np.isin(self.table["frame"], list(self.unseen))] = np.nan
        names = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
        columns: dict[str, Any] = dict(self.table)
        columns["activity"] = [frame.activity for frame in self.frames]
        columns.update(zip(names, points, strict=True))
        return columns

    @cached_property
    def intervals(self) -> dict[str, Array]:
        """The intervals of joints and angles in poses.npz.

        The keys are `levels` (3,), `joint_radii` (T, 3, 27) in metres relative to the
        root, and `angle_halves` (T, 3, 66) in radians. Tracks of footage also have
        `place_radii` (T, 3, 27) in metres in the world. Frames without a posterior have
        NaN. If no frame has a posterior, the mapping is empty.
        """
        if all(frame.posterior is None for frame in self.frames):
            return {}
        skeleton = self.scene.body.skeleton
        camera = self.scene.cameras[0]
        shape = (len(self.frames), len(LEVELS), len(JOINTS))
        radii = np.full(shape, np.nan)
        places = np.full(shape, np.nan)
        halves = np.full((len(self.frames), len(LEVELS), ANGLES), np.nan)
        for k, frame in enumerate(self.frames):
            posterior = frame.posterior
            if posterior is None:
                continue
            radii[k] = joint_intervals(skeleton, posterior, frame.pose, False)
            in_world = joint_intervals(skeleton, posterior, frame.pose, True)
            model = posterior.recalibration or Recalibration()
            depths = depth_halves(model, camera, frame.translation)
            places[k] = np.hypot(in_world, depths)
            halves[k] = angle_intervals(posterior, frame.pose)
        intervals = {
            "levels": np.array(LEVELS),
            "joint_radii": radii,
            "angle_halves": halves,
        }
        if self.scene.truth is None:
            intervals["place_radii"] = places
        return intervals
