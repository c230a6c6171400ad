"""What the silhouette of one frame leaves open: every library pose that fits nearly as well as the best.

    result = ambiguity_of("16_15", frame=20, within=2.0, train=["library:-16"])
    print(ambiguity_table(result))
    print(result.floors[0].spread_mm, result.floors[1].spread_mm)    # with one camera, and with two

Five million combinations of pose and yaw are compared from coarse to fine: every third yaw in a small image, the
neighbours of the good ones there, and at full size what is good in the small image. What a step leaves out is so much
worse than the best that the next step cannot make up for it; `MARGIN` and `BLUR` are those bounds, and the tests
compare the result with all combinations at full size.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.alignment import align
from posefit.fitting.check import finite_number, whole
from posefit.fitting.shape import NAMES, shaped
from posefit.footage.masks import FPS
from posefit.footage.scene import Scene
from posefit.footage.source import HEIGHTS, Source, kind_of, scene_of, useless_for
from posefit.footage.training import training_clips, training_motions
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, Skeleton
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses, turned_poses
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.reading import parsed_json, read_text
from posefit.silhouette.cost import pose_costs, project
from posefit.silhouette.mask import Silhouette
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette
from posefit.tracking.options import TrackOptions
from posefit.uncertainty.modes import Posterior, modes_of
from posefit.uncertainty.searches import boltzmann_weights

MIN_SPACING = 0.02  # metres between joints, root mean square: nearer poses of one clip are left out

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LibraryPoses:
    """Poses (K, 66), in the order of their clips, and where each is from. The mirror images are the second half."""

    poses: Array = field(repr=False)
    names: tuple[str, ...]  # of the clips
    clips: Rows = field(repr=False)  # (K,) number of the clip
    frames: Rows = field(repr=False)  # (K,) frame of the clip

    @classmethod
    def of(cls, motions: Sequence[Motion], skeleton: Skeleton) -> Self:
        """Return the poses of motions and their mirror images; `skeleton` is the person's.

        A frame nearer than two centimetres to the last one used of its clip is left out.
        """
        spaced = [spaced_frames(skeleton, motion.poses) for motion in motions]
        poses = [motion.poses[rows] for motion, rows in zip(motions, spaced, strict=True)]
        images = [mirrored_poses(motion.skeleton, one) for motion, one in zip(motions, poses, strict=True)]
        clips = np.repeat(np.arange(len(motions)), [len(rows) for rows in spaced])
        names = tuple(motion.name for motion in motions)
        return cls(np.concatenate(poses + images), names, np.tile(clips, 2), np.tile(np.concatenate(spaced), 2))

    def __len__(self) -> int:
        return len(self.poses)

    def is_mirrored(self, row: int) -> bool:
        """Return whether a pose is the mirror image of one that was recorded."""
        return row >= len(self) // 2


def spaced_frames(skeleton: Skeleton, poses: Array) -> Rows:
    """Return the rows of a clip's poses (n, 66) that are two centimetres or more from the last one chosen."""
    facing = poses.copy()
    facing[:, 0] = 0.0  # as the yaw of every pose is searched
    joints = skeleton.joints(facing).reshape(len(poses), -1)
    rows = [0]
    for k in range(1, len(joints)):
        step = joints[k] - joints[rows[-1]]
        if float(step @ step) > len(JOINTS) * MIN_SPACING**2:
            rows.append(k)
    return np.array(rows)


YAWS = 72  # of a full turn: five degrees apart
EVERY = 3  # yaws apart are compared first
MARGIN = 12.0  # units of cost a pose may be worse than the best at the nearest of these yaws, in a small image
BLUR = 4.0  # units of cost a pose may be worse than the best in a small image
SHRINK_FACTORS = (8, 4, 2)  # of small images
MIN_PIXELS = 400  # of a person in a small image
BATCH = 4096  # poses evaluated at a time
MAX_STATES = 20_000  # poses and yaws that can be compared with each other


@dataclass(frozen=True, eq=False)
class Moment:
    """The silhouettes of a person in one frame, from one camera or several."""

    body: Body
    cameras: Sequence[Camera]
    silhouettes: Sequence[Silhouette] = field(repr=False)
    anchor: Array  # (3,) metres: where the root is, exactly or about
    known: bool  # whether the root is known to be there; else poses are aligned to the silhouettes' borders
    threads: int = 1

    @property
    def factor(self) -> int:
        """By how much the images may be shrunk."""
        fewest = min(silhouette.pixels for silhouette in self.silhouettes if silhouette.known)
        return next((factor for factor in SHRINK_FACTORS if fewest >= factor**2 * MIN_PIXELS), 1)

    def coarser(self, factor: int) -> Self:
        """Return the same frame in smaller images."""
        cameras = [coarser_camera(camera, factor) for camera in self.cameras]
        return replace(self, cameras=cameras, silhouettes=[coarser_silhouette(one, factor) for one in self.silhouettes])

    def only(self, views: Sequence[int]) -> Self:
        """Return the same frame as some of the cameras show it."""
        return replace(self, cameras=[self.cameras[v] for v in views], silhouettes=[self.silhouettes[v] for v in views])

    def placed(self, poses: Array) -> Array:
        """Return the translations (n, 3) of poses (n, 66)."""
        anchors = np.repeat(self.anchor[None], len(poses), axis=0)
        return anchors if self.known else align(self.body, self.cameras, self.silhouettes, poses, anchors)

    def costs(self, poses: Array, translations: Array) -> Array:
        """Return the cost (n,) of poses (n, 66) at translations (n, 3): the mean over the cameras."""
        scene = self.body, self.cameras, self.silhouettes
        return pose_costs(*scene, poses, translations, threads=self.threads)[0]


@dataclass(frozen=True, eq=False)
class States:
    """Poses and yaws that fit a silhouette about equally well."""

    rows: Rows = field(repr=False)  # (n,) of the library
    poses: Array = field(repr=False)  # (n, 66) turned to their yaws
    translations: Array = field(repr=False)  # (n, 3) metres
    costs: Array = field(repr=False)  # (n,)

    def __len__(self) -> int:
        return len(self.rows)

    def weights(self, temperature: float) -> Array:
        """Return the probability of each (n,) under a uniform prior: exp(-cost / temperature), normalised."""
        return boltzmann_weights(self.costs, temperature)


def states_within(moment: Moment, poses: Array, within: float) -> States:
    """Return those of poses (K, 66), at any of 72 yaws, whose cost is at most `within` above the least.

    Raises ValueError where they are too many to compare with each other.
    """
    small = moment.coarser(moment.factor)
    rows, yaws = np.tile(np.arange(len(poses)), YAWS // EVERY), np.repeat(np.arange(0, YAWS, EVERY), len(poses))
    rows, yaws, _ = _best(small, poses, rows, yaws, within + MARGIN)
    beside = [np.mod(yaws + step, YAWS) for step in range(-(EVERY // 2), EVERY // 2 + 1)]
    rows, yaws, _ = _best(small, poses, np.tile(rows, EVERY), np.concatenate(beside), within + BLUR)
    rows, yaws, costs = _best(moment, poses, rows, yaws, within)
    if len(rows) > MAX_STATES:
        raise InputError(
            f"within must be so little that at most {MAX_STATES:,} poses and yaws are left, got {within:g}, "
            f"which leaves {len(rows):,}"
        )
    turned = turned_to(poses[rows], yaws)
    return States(rows, turned, moment.placed(turned), costs)


def turned_to(poses: Array, yaws: Rows) -> Array:
    """Return copies of poses (n, 66), each turned to one of the 72 yaws (n,)."""
    turned = np.array(poses)
    turned[:, 0] = 2.0 * np.pi / YAWS * yaws
    turned[turned[:, 0] > np.pi, 0] -= 2.0 * np.pi
    return turned


def _best(moment: Moment, poses: Array, rows: Rows, yaws: Rows, within: float) -> tuple[Rows, Rows, Array]:
    """Return the rows (n,) and yaws (n,) whose cost is at most `within` above the least, and their costs."""
    costs = np.empty(len(rows))
    for start in range(0, len(rows), BATCH):
        part = slice(start, start + BATCH)
        turned = turned_to(poses[rows[part]], yaws[part])
        costs[part] = moment.costs(turned, moment.placed(turned))
    best = costs <= costs.min() + within
    return rows[best], yaws[best], costs[best]


MAX_COMPARED = 1500  # poses compared with each other; of more, a random sample stands for all
IMAGE_TOLERANCE = 0.5  # a mode nearer to an image of the first one than this share of their distance is that image


@dataclass(frozen=True, eq=False)
class PoseCluster:
    """Similar poses, represented by the one that fits best."""

    weight: float
    members: Rows = field(repr=False)  # rows of the states
    best: int  # row of the states
    spread_mm: float  # of the joints about their mean
    away_mm: float  # mean distance of the best one's joints from those of the first cluster's best one
    image: str  # of the first cluster: mirrored, turned or reflected, see posefit.geometry.symmetry; or ""


def clusters_of(moment: Moment, states: States, weights: Array) -> list[PoseCluster]:
    """Return clusters of states with weights (n,) by their joints relative to the root, the heaviest first."""
    skeleton = moment.body.skeleton
    some = np.sort(
        np.random.default_rng(0).permutation(len(states))[:MAX_COMPARED]
    )  # a regular stride could pick similar ones
    modes = modes_of(skeleton, Posterior(states.poses[some], states.translations[some], weights[some]))
    joints, middles = (_rooted(skeleton, poses) for poses in (states.poses, np.array([mode.pose for mode in modes])))
    away = np.array([_distances(joints, middle) for middle in middles])
    nearest = away.argmin(axis=0)
    groups = [rows for k in range(len(modes)) if len(rows := np.flatnonzero(nearest == k))]
    groups.sort(key=lambda rows: -weights[rows].sum())
    best = [int(rows[states.costs[rows].argmin()]) for rows in groups]
    first = joints[best[0]]
    images = _images(moment, states.poses[best[0]])
    return [
        PoseCluster(
            float(weights[rows].sum()),
            rows,
            one,
            total(spread_mm(joints[rows], weights[rows])),
            float(_distances(joints[one][None], first)[0]),
            _image(joints[one], first, images),
        )
        for rows, one in zip(groups, best, strict=True)
    ]


def spread_mm(joints: Array, weights: Array) -> Array:
    """Return the spread (27,) of joints (n, 27, 3): their root mean square distance from their mean, by weights (n,).

    Metres become millimetres; weights need not sum to 1.
    """
    weights = weights / weights.sum()
    mean = np.einsum("n,njk->jk", weights, joints)
    squares = ((joints - mean) ** 2).sum(axis=2)
    return np.asarray(1e3 * np.sqrt(weights @ squares))


def floor_mm(moment: Moment, states: States, weights: Array) -> Array:
    """Return the spread (27,) in millimetres of ambiguous states, all roots at one point."""
    return spread_mm(_rooted(moment.body.skeleton, states.poses), weights)


def distance_mm(skeleton: Skeleton, pose: Array, other: Array) -> float:
    """Return the mean distance in millimetres of the joints of two poses (66,), both roots at one point."""
    joints = _rooted(skeleton, np.stack([pose, other]))
    return float(_distances(joints[:1], joints[1])[0])


def total(spreads_mm: Array) -> float:
    """Return the spread of a body, of those (27,) of its joints: their root mean square."""
    return float(np.sqrt((spreads_mm**2).mean()))


def _images(moment: Moment, pose: Array) -> dict[str, Array]:
    """Return the joints of the poses whose silhouettes resemble that of a pose, by name."""
    skeleton, poses = moment.body.skeleton, pose[None]
    towards = facing(moment.cameras[0], moment.anchor)
    images = {
        "mirrored": mirrored_poses(skeleton, poses),
        "turned": turned_poses(poses),
        "reflected": reflected_poses(skeleton, poses, towards),
    }
    return {name: _rooted(skeleton, image)[0] for name, image in images.items()}


def _image(joints: Array, first: Array, images: dict[str, Array]) -> str:
    """Return which image of the first pose some joints (27, 3) are, or "" where they are none."""
    # to a millimetre, as from its very side a mirrored pose is the reflected one as well
    away = {name: round(float(_distances(joints[None], image)[0])) for name, image in images.items()}
    name = min(away, key=away.__getitem__)
    return name if away[name] < IMAGE_TOLERANCE * float(_distances(joints[None], first)[0]) else ""


def _rooted(skeleton: Skeleton, poses: Array) -> Array:
    """Return the joints (n, 27, 3) of poses (n, 66), their roots at one point."""
    joints = skeleton.joints(poses)
    return np.asarray(joints - joints[:, :1])


def _distances(joints: Array, other: Array) -> Array:
    """Return the mean distances (n,) in millimetres of joints (n, 27, 3) from others (27, 3)."""
    return np.asarray(1e3 * np.linalg.norm(joints - other, axis=2).mean(axis=1))


SUMMARY = "summary.json"
MAX_SUMMARY_BYTES = 10_000_000
BUILD_RANGE = (0.1, 10.0)  # of factors on the average build


def body_of(folder: str | Path, body: Body) -> Body:
    """Return the body with the build fitted in an earlier track, read from its folder.

    Raises ValueError where the folder holds no valid build.
    """
    path = Path(folder) / SUMMARY
    if not path.is_file():
        raise InputError(f"{folder}: expected the folder of a track with its {SUMMARY}, got none")
    text = read_text(path, MAX_SUMMARY_BYTES)
    try:
        summary = parsed_json(text)
    except ValueError as error:
        raise InputError(f"{path}: expected a JSON object, got {error}") from None
    try:
        build = summary["body"] if isinstance(summary, Mapping) else None
        if not isinstance(build, Mapping):
            raise InputError("expected the build of a person, got none: it was not fitted")
        factors_by_name = build["factors"]
        factors = np.array([_within(name, factors_by_name[name], BUILD_RANGE) for name in NAMES])
        return shaped(body, factors, _within("stature", build["stature"], HEIGHTS))
    except (ValueError, KeyError, TypeError) as error:
        message = f"expected {error.args[0]} in it, got none" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: {message}") from None


def _within(name: str, value: object, ends: tuple[float, float]) -> float:
    """Return a finite number between two ends. Raises ValueError otherwise."""
    number = finite_number(name, value)
    if not ends[0] <= number <= ends[1]:
        raise InputError(f"{name} must lie in {ends[0]:g} to {ends[1]:g}, got {number:g}")
    return number


RIGHT_ANGLE = np.radians(90.0)


@dataclass(frozen=True, eq=False)
class Floor:
    """The spread of all states that some cameras cannot distinguish."""

    views: str  # which cameras
    count: int  # poses and yaws that cannot be distinguished
    least: float  # cost
    joints_mm: Array = field(repr=False)  # (27,)

    @property
    def spread_mm(self) -> float:
        """The spread of the body: the root mean square of its joints' spreads."""
        return total(self.joints_mm)


@dataclass(frozen=True, eq=False)
class Ambiguity:
    """Everything that fits the silhouettes of one frame nearly equally well."""

    scene: Scene = field(repr=False)
    frame: int
    within: float
    temperature: float
    moment: Moment = field(repr=False)
    library: LibraryPoses = field(repr=False)
    states: States = field(repr=False)  # of all cameras together
    clusters: Sequence[PoseCluster]  # the heaviest first
    floors: Sequence[Floor]  # the first is that of `states`
    truth_mm: Sequence[float] | None  # distance of each cluster's best pose from the truth, where it is known
    seconds: float


def ambiguity_of(
    source: Source | Sequence[Source] = "walk",
    *,
    frame: int = 0,
    within: float = 1.0,
    temperature: float = 2.0,
    train: Sequence[Source] = (recorded.LIBRARY,),
    translation: Literal["known", "aligned"] | None = None,
    build: str | Path | None = None,
    threads: int = 1,
    say: Callable[[str], None] | None = None,
    **options: Any,
) -> Ambiguity:
    """Return every library pose that costs at most `within` more than the best one in one frame of a source.

    `source` and the `options` that say how it is looked at, such as `view_degrees`, are as for `posefit.track`; the
    frame of a motion is counted after resampling, of footage as filmed. The poses are those of `train` and their
    mirror images, each at 72 yaws, without the source's own clip; their weights are exp(-cost / temperature). The
    root stands at its known translation or, for footage and where `translation` is "aligned", where the body fills
    the silhouettes' borders. `build` is the folder of a track of the same footage, whose fitted build is used;
    otherwise the body is average. The floor of one camera is compared with that of two: for a known motion a second
    camera at right angles is added; of several cameras each is also taken alone. Raises ValueError for every
    mistake in the arguments or files.
    """
    frame, threads = whole("frame", frame, 0), whole("threads", threads, 1)
    if not finite_number("within", within) >= 0.0:
        raise InputError(f"within must be 0 or more, got {within:g}")
    if not finite_number("temperature", temperature) > 0.0:
        raise InputError(f"temperature must be above 0, got {temperature:g}")
    if translation not in (None, "known", "aligned"):
        raise InputError(f"translation must be known or aligned, got {translation}")
    sources = source if isinstance(source, Sequence) and not isinstance(source, str) else [source]
    motion = kind_of(sources[0]) == "motion"
    if not motion and translation == "known":
        raise InputError("translation must be aligned where only masks are given, got known")
    if motion and build is not None:
        raise useless_for("motion", "build", str(build), "footage")
    viewing = TrackOptions(**options)
    clips = training_clips(train, viewing.asf, followed=sources[0])  # before the work, as a name may be wrong
    progress = Progress(say or QUIET.log, QUIET.steps)
    if not motion:
        viewing = viewing.changed(frames=(frame, frame + 1))
    scene = scene_of(sources, progress, **viewing.view)
    if build is not None:
        scene = replace(scene, body=body_of(build, scene.body))
    moment = _moment(scene, frame if motion else 0, frame, translation, threads)
    for warning in scene.warnings:
        progress.warn(warning)
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
    """Return frame k of a scene, which users call `frame`. Raises ValueError where it shows no person."""
    if not k < scene.count:
        raise InputError(f"frame must lie in 0 to {scene.count - 1} of {scene.name}, got {frame}")
    observation = scene.observations[k]
    shown = any(silhouette.mask.any() for silhouette in observation.silhouettes)
    if not (observation.usable and shown):
        came = "one that shows too little of the person" if shown else "an empty mask"
        raise InputError(f"frame must show the person, got {came} in frame {frame} of {scene.name}")
    known = scene.truth is not None and translation != "aligned"
    anchor = scene.anchor if observation.translation is None else np.asarray(observation.translation)
    return Moment(scene.body, scene.cameras, observation.silhouettes, anchor, known, threads)


def _others(scene: Scene, moment: Moment, frame: int) -> list[tuple[str, Moment]]:
    """Return the camera sets to compare with, by name: each camera alone, or the only one with a second."""
    if len(moment.cameras) > 1:
        visible = [v for v, silhouette in enumerate(moment.silhouettes) if silhouette.mask.any()]
        return [(f"camera {v + 1}", moment.only([v])) for v in visible]
    if scene.truth is None:
        return []
    pose, place = scene.truth.poses[frame], scene.truth.translations[frame]
    camera = camera_about(moment.cameras[0], place, RIGHT_ANGLE)
    silhouette = Silhouette.of(project(moment.body, camera, pose, place))
    both = Moment(
        moment.body,
        [*moment.cameras, camera],
        [*moment.silhouettes, silhouette],
        moment.anchor,
        moment.known,
        moment.threads,
    )
    return [("two cameras, the second at right angles", both)]


def camera_about(camera: Camera, place: Array, angle: float) -> Camera:
    """Return the camera turned by `angle` radians about the vertical through a place (3,)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    rotation = camera.rotation @ turn.T
    translation = camera.rotation @ place + camera.translation - rotation @ place
    return Camera(camera.width, camera.height, camera.focal, camera.centre, rotation, translation)


def _name(moment: Moment) -> str:
    return {1: "one camera", 2: "both cameras"}.get(len(moment.cameras), f"all {len(moment.cameras)} cameras")


def _floor(name: str, moment: Moment, states: States, temperature: float) -> Floor:
    return Floor(name, len(states), float(states.costs.min()), floor_mm(moment, states, states.weights(temperature)))
