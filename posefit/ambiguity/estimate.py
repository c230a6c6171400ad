"""What the silhouette of one frame leaves open: every library pose that fits nearly as well as the best.

    result = ambiguity_of("16_15", frame=20, within=2.0, train=["library:-16"])
    print(ambiguity_table(result))
    print(result.floors[0].spread_mm, result.floors[1].spread_mm)    # with one camera, and with two

Five million combinations of pose and yaw are compared from coarse to fine: every third yaw in a small image, the
neighbours of the good ones there, and at full size what is good in the small image. `MARGIN` and `BLUR` bound what a
step may leave out; the tests compare the result with all combinations at full size.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import at_least, between, finite_number, one_of, positive, whole
from posefit.fitting.prior import Components
from posefit.fitting.problem import PoseProblem
from posefit.fitting.shape import NAMES, shaped
from posefit.fitting.space import SearchSpace
from posefit.footage.masks import FPS
from posefit.footage.scene import Scene
from posefit.footage.source import Source, kind_of, scene_of, training_clips, training_motions, useless_for
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses, turned_poses
from posefit.limits import HEIGHTS
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.reading import parsed_json, read_text
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.tracking.options import TrackOptions
from posefit.uncertainty.modes import Posterior, modes_of, poses_apart
from posefit.uncertainty.searches import boltzmann_weights

MIN_SPACING = 0.02  # metres between joints, root mean square: nearer poses of one clip are left out

Rows = NDArray[np.int64]


class Origin(NamedTuple):
    """Where a pose of the library comes from."""

    clip: str
    frame: int
    mirrored: bool


def library_of(motions: Sequence[Motion], skeleton: Skeleton) -> tuple[Array, list[Origin]]:
    """Return the poses (K, 66) of motions, then their mirror images, and the origin of each.

    A frame nearer than two centimetres to the last one used of its clip is left out; `skeleton` is the person's.
    """
    spaced = [(motion, spaced_frames(skeleton, motion.poses)) for motion in motions]
    poses = [motion.poses[rows] for motion, rows in spaced]
    images = [mirrored_poses(motion.skeleton, some) for (motion, _), some in zip(spaced, poses, strict=True)]
    frames = [(motion.name, int(row)) for motion, rows in spaced for row in rows]
    return np.concatenate(poses + images), [Origin(*frame, mirrored) for mirrored in (False, True) for frame in frames]


def spaced_frames(skeleton: Skeleton, poses: Array) -> Rows:
    """Return the rows of a clip's poses (n, 66) that are two centimetres or more from the last one chosen."""
    joints = skeleton.joints(turned_to(poses, np.zeros(len(poses), dtype=np.int64))).reshape(len(poses), -1)
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


def problem_of(
    body: Body,
    cameras: Sequence[Camera],
    silhouettes: Sequence[Silhouette],
    anchor: Array,
    known: bool,
    threads: int = 1,
) -> PoseProblem:
    """Return the problem of one frame, whose root is known to be at its anchor (3,), or else aligned from there.

    Its space has no latents: poses are the library's.
    """
    none = Components(np.zeros(ANGLES - 3), np.empty((0, ANGLES - 3)), np.empty(0), np.empty(0))
    space = SearchSpace(none, np.zeros(3), np.zeros(3), anchor, "known" if known else "aligned")
    return PoseProblem(body, cameras, silhouettes, space, threads=threads)


@dataclass(frozen=True, eq=False)
class States:
    """Poses and yaws that fit a silhouette about equally well."""

    rows: Rows = field(repr=False)  # (n,) of the library
    posterior: Posterior = field(repr=False)  # turned to their yaws; under a uniform prior, exp(-cost / temperature)
    costs: Array = field(repr=False)  # (n,)

    def __len__(self) -> int:
        return len(self.rows)


def states_within(problem: PoseProblem, poses: Array, within: float, temperature: float) -> States:
    """Return those of poses (K, 66), at any of 72 yaws, whose cost is at most `within` above the least.

    Raises ValueError where they are too many to compare with each other.
    """
    fewest = min(silhouette.pixels for silhouette in problem.silhouettes if silhouette.known)
    small = problem.coarser(next((factor for factor in SHRINK_FACTORS if fewest >= factor**2 * MIN_PIXELS), 1))
    rows, yaws = np.tile(np.arange(len(poses)), YAWS // EVERY), np.repeat(np.arange(0, YAWS, EVERY), len(poses))
    rows, yaws, _ = _best(small, poses, rows, yaws, within + MARGIN)
    beside = [np.mod(yaws + step, YAWS) for step in range(-(EVERY // 2), EVERY // 2 + 1)]
    rows, yaws, _ = _best(small, poses, np.tile(rows, EVERY), np.concatenate(beside), within + BLUR)
    rows, yaws, costs = _best(problem, poses, rows, yaws, within)
    if len(rows) > MAX_STATES:
        raise InputError(
            f"within must be so little that at most {MAX_STATES:,} poses and yaws are left, got {within:g}, "
            f"which leaves {len(rows):,}"
        )
    turned = turned_to(poses[rows], yaws)
    return States(rows, Posterior(turned, problem.placed(turned), boltzmann_weights(costs, temperature)), costs)


def turned_to(poses: Array, yaws: Rows) -> Array:
    """Return copies of poses (n, 66), each turned to one of the 72 yaws (n,)."""
    turned = np.array(poses)
    turned[:, 0] = 2.0 * np.pi / YAWS * yaws
    turned[turned[:, 0] > np.pi, 0] -= 2.0 * np.pi
    return turned


def _best(problem: PoseProblem, poses: Array, rows: Rows, yaws: Rows, within: float) -> tuple[Rows, Rows, Array]:
    """Return the rows (n,) and yaws (n,) whose cost is at most `within` above the least, and their costs."""
    costs = np.empty(len(rows))
    for start in range(0, len(rows), BATCH):
        part = slice(start, start + BATCH)
        turned = turned_to(poses[rows[part]], yaws[part])
        costs[part] = problem.cost(turned, problem.placed(turned))
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


def clusters_of(problem: PoseProblem, states: States) -> list[PoseCluster]:
    """Return clusters of states by their joints relative to the root, the heaviest first."""
    skeleton, poses, weights = problem.body.skeleton, states.posterior.poses, states.posterior.weights
    # a random sample, as a regular stride could pick similar poses
    some = np.sort(np.random.default_rng(0).permutation(len(states))[:MAX_COMPARED])
    modes = modes_of(skeleton, Posterior(poses[some], states.posterior.translations[some], weights[some]))
    nearest = poses_apart(skeleton, np.array([mode.pose for mode in modes]), poses).argmin(axis=0)
    groups = [rows for k in range(len(modes)) if len(rows := np.flatnonzero(nearest == k))]
    groups.sort(key=lambda rows: -weights[rows].sum())
    best = [int(rows[states.costs[rows].argmin()]) for rows in groups]
    first, towards = poses[best[:1]], facing(problem.cameras[0], problem.space.anchor)
    images = {
        "mirrored": mirrored_poses(skeleton, first),
        "turned": turned_poses(first),
        "reflected": reflected_poses(skeleton, first, towards),
    }
    away = 1e3 * poses_apart(skeleton, poses[best], first)[:, 0]
    # to a millimetre, as in a side view a mirrored pose is the reflected one as well
    from_images = np.round(1e3 * poses_apart(skeleton, poses[best], np.concatenate([*images.values()])))
    clusters = []
    for k, rows in enumerate(groups):
        image = [*images][from_images[k].argmin()] if from_images[k].min() < IMAGE_TOLERANCE * away[k] else ""
        _, spread = spreads_mm(skeleton, poses[rows], weights[rows])
        clusters.append(PoseCluster(float(weights[rows].sum()), rows, best[k], spread, float(away[k]), image))
    return clusters


def spreads_mm(skeleton: Skeleton, poses: Array, weights: Array) -> tuple[Array, float]:
    """Return the spread (27,) in millimetres of the joints of poses (n, 66) with weights (n,), and that of the body.

    A joint's is the root mean square distance from its mean, all roots at one point; the body's is that of its joints.
    Weights need not sum to 1.
    """
    joints, weights = skeleton.joints(poses), weights / weights.sum()
    squares = weights @ ((joints - np.einsum("n,njk->jk", weights, joints)) ** 2).sum(axis=2)
    return 1e3 * np.sqrt(squares), 1e3 * float(np.sqrt(squares.mean()))


MAX_SUMMARY_BYTES = 10_000_000
BUILD_RANGE = (0.1, 10.0)  # of factors on the average build


def body_of(folder: str | Path, body: Body) -> Body:
    """Return the body with the build fitted in an earlier track, read from its folder.

    Raises ValueError where the folder holds no valid build.
    """
    path = Path(folder) / "summary.json"
    if not path.is_file():
        raise InputError(f"{folder}: expected the folder of a track with its {path.name}, got none")
    try:
        build = parsed_json(read_text(path, MAX_SUMMARY_BYTES))["body"]
        if build is None:
            raise InputError("expected the build of a person, got none: it was not fitted")
        stature, factors = finite_number("stature", build["stature"]), build["factors"]
        between("stature", stature, *HEIGHTS)
        for name in NAMES:
            between(name, finite_number(name, factors[name]), *BUILD_RANGE)
        return shaped(body, np.array([factors[name] for name in NAMES]), stature)
    except KeyError as error:
        raise InputError(f"{path}: expected {error.args[0]} in it, got none") from None
    except (ValueError, TypeError) as error:
        message = error if isinstance(error, InputError) else f"expected a JSON object, got {error}"
        raise InputError(f"{path}: {message}") from None


RIGHT_ANGLE = np.radians(90.0)


@dataclass(frozen=True, eq=False)
class Floor:
    """The spread of the poses that some cameras cannot distinguish."""

    views: str  # which cameras
    count: int  # poses and yaws that cannot be distinguished
    least: float  # cost
    joints_mm: Array = field(repr=False)  # (27,)
    spread_mm: float  # of the body: the root mean square of its joints' spreads


@dataclass(frozen=True, eq=False)
class Ambiguity:
    """Everything that fits the silhouettes of one frame nearly equally well."""

    scene: Scene = field(repr=False)
    frame: int
    within: float
    temperature: float
    problem: PoseProblem = field(repr=False)
    library: Sequence[Origin] = field(repr=False)  # of its poses
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

    `source` and the `options` of its view, such as `view_degrees`, are as for `posefit.track`; the frame of a motion is
    counted after resampling, of footage as filmed. The poses are those of `train` and their mirror images, each at 72
    yaws, without the source's own clip; their weights are exp(-cost / temperature). The root is at its known
    translation or, for footage and where `translation` is "aligned", where the body fills the silhouettes' borders.
    `build` is the folder of a track of the same footage, whose fitted build is used; otherwise the body is average. The
    spread with one camera is compared with that of two: for a known motion a second camera at right angles is added; of
    several cameras each is also taken alone. Raises ValueError for every mistake in the arguments or files.
    """
    frame, threads = whole("frame", frame, 0), whole("threads", threads, 1)
    at_least("within", finite_number("within", within), 0.0)
    positive("temperature", finite_number("temperature", temperature))
    if translation is not None:
        one_of("translation", translation, ("known", "aligned"))
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
    problem = _problem(scene, frame if motion else 0, frame, translation, threads)
    for warning in scene.warnings:
        progress.warn(warning)
    began = time.perf_counter()
    poses, library = library_of(training_motions(clips, FPS), scene.body.skeleton)
    views = {1: "one camera", 2: "both cameras"}.get(len(problem.cameras), f"all {len(problem.cameras)} cameras")
    found, floors = [], []
    for name, each in [(views, problem), *_others(scene, problem, frame)]:
        found.append(states_within(each, poses, within, temperature))
        spreads = spreads_mm(scene.body.skeleton, found[-1].posterior.poses, found[-1].posterior.weights)
        floors.append(Floor(name, len(found[-1]), float(found[-1].costs.min()), *spreads))
    states = found[0]
    clusters = clusters_of(problem, states)
    truth = None
    if scene.truth is not None:
        best = states.posterior.poses[[cluster.best for cluster in clusters]]
        truth = (1e3 * poses_apart(scene.body.skeleton, best, scene.truth.poses[frame : frame + 1])[:, 0]).tolist()
    seconds = time.perf_counter() - began
    return Ambiguity(scene, frame, within, temperature, problem, library, states, clusters, floors, truth, seconds)


def _problem(scene: Scene, k: int, frame: int, translation: str | None, threads: int) -> PoseProblem:
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
    return problem_of(scene.body, scene.cameras, observation.silhouettes, anchor, known, threads)


def _others(scene: Scene, problem: PoseProblem, frame: int) -> list[tuple[str, PoseProblem]]:
    """Return the camera sets to compare with, by name: each camera alone, or the only one with a second."""
    views = list(zip(problem.cameras, problem.silhouettes, strict=True))
    if len(views) > 1:
        return [
            (f"camera {k}", replace(problem, cameras=[camera], silhouettes=[silhouette]))
            for k, (camera, silhouette) in enumerate(views, 1)
            if silhouette.mask.any()
        ]
    if scene.truth is None:
        return []
    pose, place = scene.truth.poses[frame], scene.truth.translations[frame]
    camera = camera_about(problem.cameras[0], place, RIGHT_ANGLE)
    silhouette = Silhouette.of(project(problem.body, camera, pose, place))
    both = replace(problem, cameras=[*problem.cameras, camera], silhouettes=[*problem.silhouettes, silhouette])
    return [("two cameras, the second at right angles", both)]


def camera_about(camera: Camera, place: Array, angle: float) -> Camera:
    """Return the camera turned by `angle` radians about the vertical through a place (3,)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    rotation = camera.rotation @ turn.T
    translation = camera.rotation @ place + camera.translation - rotation @ place
    return replace(camera, rotation=rotation, translation=translation)
