"""`posefit.ambiguity.ambiguity_of`: one frame of a source is held against the library, by one camera and by more."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from posefit.ambiguity.build import body_of
from posefit.ambiguity.clusters import AlikePoses, clusters_of, distance_mm, floor_mm, total
from posefit.ambiguity.library import LibraryPoses
from posefit.ambiguity.search import Moment, States, states_within
from posefit.arrays import Array
from posefit.fitting.check import finite_number, whole
from posefit.footage.masks import FPS
from posefit.footage.scene import Scene
from posefit.footage.source import Source, Viewing, kind_of, scene_of, useless_for
from posefit.footage.training import training_clips, training_motions
from posefit.geometry.camera import Camera
from posefit.listening import QUIET, Listener
from posefit.motion import recorded
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette

RIGHT_ANGLE = np.radians(90.0)


@dataclass(frozen=True, eq=False)
class Floor:
    """How little is known by some cameras: the spread of all that they do not tell apart."""

    views: str  # which cameras
    count: int  # poses and yaws that are not told apart
    least: float  # cost
    joints_mm: Array = field(repr=False)  # (27,)

    @property
    def spread_mm(self) -> float:
        """The spread of the body: the root mean square of its joints' spreads."""
        return total(self.joints_mm)


@dataclass(frozen=True, eq=False)
class Ambiguity:
    """What the silhouettes of one frame leave open."""

    scene: Scene = field(repr=False)
    frame: int
    within: float
    temperature: float
    moment: Moment = field(repr=False)
    library: LibraryPoses = field(repr=False)
    states: States = field(repr=False)  # of all cameras together
    clusters: Sequence[AlikePoses]  # the heaviest first
    floors: Sequence[Floor]  # the first is that of `states`
    truth_mm: Sequence[float] | None  # how far each cluster's best pose is from the truth, where somebody knows it
    seconds: float


def ambiguity_of(
    source: Source | Sequence[Source] = "walk",
    *,
    frame: int = 0,
    within: float = 1.0,
    temperature: float = 2.0,
    train: Sequence[Source] = (recorded.LIBRARY,),
    translation: Literal["known", "aligned"] | None = None,
    viewing: Viewing | None = None,
    build: str | Path | None = None,
    threads: int = 1,
    say: Callable[[str], None] | None = None,
) -> Ambiguity:
    """Return every pose of the library that costs at most `within` more than the best one in one frame of a source.

    `source` and `viewing` are what `posefit.track` takes; of motions the frame is counted after resampling, of footage
    as filmed. The poses are those of `train` and their mirror images, each at 72 yaws, but for the clip that is the
    source. Their weights are exp(-cost / temperature). The root stands where it is known to be, or, where
    `translation` is "aligned" and for footage, where the body fills the silhouettes' borders. `build` is the folder of
    a track of the same footage, whose build the person has; without it he has the average one. One camera's floor is
    held against that of two: of a known motion, whose second camera stands at right angles to the only one; of several
    cameras, against that of each. Raises ValueError for every mistake in the arguments or files.
    """
    frame, threads = whole("frame", frame, 0), whole("threads", threads, 1)
    if not finite_number("within", within) >= 0.0:
        raise ValueError(f"within must be 0 or more, got {within:g}")
    if not finite_number("temperature", temperature) > 0.0:
        raise ValueError(f"temperature must be above 0, got {temperature:g}")
    if translation not in (None, "known", "aligned"):
        raise ValueError(f"translation must be known or aligned, got {translation}")
    sources = source if isinstance(source, Sequence) and not isinstance(source, str) else [source]
    motion = kind_of(sources[0]) == "motion"
    if not motion and translation == "known":
        raise ValueError("translation must be aligned where only masks are given, got known")
    if motion and build is not None:
        raise useless_for("motion", "build", str(build), "footage")
    viewing = viewing or Viewing()
    clips = training_clips(train, viewing.asf, followed=sources[0])  # before the work, as a name may be wrong
    listener = Listener(say or QUIET.say, QUIET.progress)
    with tempfile.TemporaryDirectory(prefix="posefit-") as work:
        if not motion:
            viewing = replace(viewing, frames=(frame, frame + 1))
        scene = scene_of(sources, viewing, Path(work), listener)
        if build is not None:
            scene = replace(scene, body=body_of(build, scene.body))
        moment = _moment(scene, frame if motion else 0, frame, translation, threads)
    for warning in scene.warnings:
        listener.say(f"warning: {warning}")
    began = time.perf_counter()
    library = LibraryPoses.of(training_motions(clips, FPS), scene.body.skeleton)
    states = states_within(moment, library.poses, within)
    clusters = clusters_of(moment, states, states.weights(temperature))
    truth = None
    if scene.truth is not None:
        right = scene.truth.poses[frame]
        truth = [distance_mm(scene.body.skeleton, states.poses[one.best], right) for one in clusters]
    floors = [_floor(_name(moment), moment, states, temperature)]
    for name, other in _others(scene, moment, frame):
        floors.append(_floor(name, other, states_within(other, library.poses, within), temperature))
    seconds = time.perf_counter() - began
    return Ambiguity(scene, frame, within, temperature, moment, library, states, clusters, floors, truth, seconds)


def _moment(scene: Scene, k: int, frame: int, translation: str | None, threads: int) -> Moment:
    """Return what was seen in frame k of a scene, which users call `frame`. Raises ValueError where that is nothing."""
    if not k < scene.count:
        raise ValueError(f"frame must lie in 0 to {scene.count - 1} of {scene.name}, got {frame}")
    observation = scene.observations[k]
    shown = any(silhouette.mask.any() for silhouette in observation.silhouettes)
    if not (observation.usable and shown):
        came = "one that shows too little of the person" if shown else "an empty mask"
        raise ValueError(f"frame must show the person, got {came} in frame {frame} of {scene.name}")
    known = scene.truth is not None and translation != "aligned"
    anchor = scene.anchor if observation.translation is None else np.asarray(observation.translation)
    return Moment(scene.body, scene.cameras, observation.silhouettes, anchor, known, threads)


def _others(scene: Scene, moment: Moment, frame: int) -> list[tuple[str, Moment]]:
    """Return the looks that one is held against, by name: each camera alone, or one camera and another."""
    if len(moment.cameras) > 1:
        seeing = [v for v, silhouette in enumerate(moment.silhouettes) if silhouette.mask.any()]
        return [(f"camera {v + 1}", moment.only([v])) for v in seeing]
    if scene.truth is None:
        return []
    pose, place = scene.truth.poses[frame], scene.truth.translations[frame]
    camera = camera_about(moment.cameras[0], place, RIGHT_ANGLE)
    seen = Silhouette.of(project(moment.body, camera, pose, place))
    both = Moment(
        moment.body,
        [*moment.cameras, camera],
        [*moment.silhouettes, seen],
        moment.anchor,
        moment.known,
        moment.threads,
    )
    return [("two cameras, the second at right angles", both)]


def camera_about(camera: Camera, place: Array, angle: float) -> Camera:
    """Return the camera that sees a place (3,) as this one does, from so many radians farther about the vertical."""
    sine, cosine = np.sin(angle), np.cos(angle)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    rotation = camera.rotation @ turn.T
    translation = camera.rotation @ place + camera.translation - rotation @ place
    return Camera(camera.width, camera.height, camera.focal, camera.centre, rotation, translation)


def _name(moment: Moment) -> str:
    return {1: "one camera", 2: "both cameras"}.get(len(moment.cameras), f"all {len(moment.cameras)} cameras")


def _floor(name: str, moment: Moment, states: States, temperature: float) -> Floor:
    return Floor(name, len(states), float(states.costs.min()), floor_mm(moment, states, states.weights(temperature)))
