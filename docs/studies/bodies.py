"""Tracks of recorded people in other bodies, with masks of a known truth.

    python docs/studies/bodies.py films
    python docs/studies/bodies.py films --report
    python docs/studies/bodies.py films --legs

The motions are those of the library's people, who are each left out of it. Their bodies
get other proportions, drawn with the spreads and correlations of adults, other girths,
and flesh off the joints' centres. One, two or four cameras at eight metres film them,
with calibrations that are slightly wrong. The masks are damaged as by a segmenter. Half
of the films by one camera have landmarks that sometimes exchange left and right. Ten
films are tracked with five seeds.

Each track is stored in the folder, and the same command continues there. The report
has the errors that the intervals do not contain yet, learned from all bodies; each body
is judged by what is learned from the others. With `--legs`, thighs and shanks have the
girths and lengths of a published survey, and their flesh is behind the bones, as it is
in people. Some of these people stand upright.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, Self
from unittest.mock import patch

import click
import cv2
import numpy as np
from scipy.special import ndtri

from angles import SAGITTAL, angle_errors
from composites_scene import (
    ACROSS,
    DISTANCE,
    HEIGHT,
    MIRRORED,
    PLACES,
    SIZE,
    facing_elsewhere,
    frames_of,
    heading,
    middle_of,
    moved,
    on_ground,
    walked_on,
)
from flesh import LENGTHS as PUBLISHED
from flesh import Legs, legs_of, painted
from posefit import clinical_angles
from posefit.arrays import Array
from posefit.evaluation import trust
from posefit.evaluation.trust import Grade
from posefit.fitting import metrics
from posefit.fitting.landmarks import GROUPS
from posefit.fitting.landmarks import MIRRORED as OTHER_SIDE
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.shape import COVARIANCE, LENGTHS, NAMES, shaped
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    rotation_from_root_angles,
)
from posefit.geometry.skeleton import (
    BONES,
    JOINTS,
    PARENTS,
    angle_index,
    joint_distances,
    kind,
)
from posefit.measuring.gait import Gait, gait_of
from posefit.measuring.segments import SIDES
from posefit.motion import built_in, recorded
from posefit.motion.motion import Motion, at_frames
from posefit.progress import QUIET
from posefit.silhouette.corruption import corrupted, wandering
from posefit.silhouette.cost import project
from posefit.tracking.front import track
from posefit.tracking.result import Track
from posefit.uncertainty.calibration import LEVELS, MAIN_LEVEL, Recalibration
from posefit.uncertainty.intervals import quantiles
from posefit.uncertainty.shared import DEPTH, PARTS, STATURE, shared_spreads
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept, markdown, percent

# largest difference of a part's girth from the average's, as a share
GIRTH = 0.1
# Standard deviations in metres of the flesh's middle from the joints: to the side,
# upwards, forwards. Ours.
OFFSETS: Mapping[str, tuple[float, float, float]] = {
    "root": (0.0, 0.015, 0.02),
    "hipjoint": (0.01, 0.015, 0.015),
    "femur": (0.005, 0.007, 0.007),
    "tibia": (0.005, 0.01, 0.01),
    "foot": (0.005, 0.01, 0.015),
    "lowerback": (0.0, 0.01, 0.025),
    "upperback": (0.0, 0.01, 0.025),
    "thorax": (0.0, 0.01, 0.025),
    "lowerneck": (0.0, 0.01, 0.015),
    "clavicle": (0.015, 0.02, 0.02),
    "humerus": (0.005, 0.007, 0.007),
    "radius": (0.005, 0.007, 0.007),
}
# standard deviations of rotation, place in metres, and focal length as a share
CALIBRATION_OFF = (np.radians(0.2), 0.01, 0.005)
# pixels: standard deviations of a film's border, and of the border along the outline
RIM = 0.5
ROUGH = 0.7
DAMAGE = {"holes": 0.1, "blobs": 0.1}
SHADOW = 0.15
SMALL = (480, 270)  # pixels of films whose people have published legs
LANDMARK_OFF = 0.02  # metres, constant in a film, and again in each frame
# shares of the frames in which a film's landmarks exchange legs, or arms
EXCHANGED = (0.03, 0.15, 0.4)
EXCHANGE_FRAMES = 6.0  # average length of an exchange
LONGEST = 60  # frames of people who stay
WALK_METRES = 2.6
BODIES = 10
# number of films with several seeds, and of seeds
SEVERAL = 10
SEEDS = 5
SOONER = 60  # number of films before the other seeds
# tried shared errors in metres
GRID = 1e-3 * np.array(
    [0, 5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 80, 100, 120, 150]
)
STRIDE = 2  # every second frame counts
JOINTS_OF = {
    part: [j for j, joint in enumerate(JOINTS) if kind(joint) in names]
    for part, names in PARTS.items()
}
SEGMENTS = {
    name: BONES.index(f"l{bone}")
    for name, bone in {
        "thigh": "femur",
        "shank": "tibia",
        "upper arm": "humerus",
        "forearm": "radius",
    }.items()
}
# knees, ankles, balls
LEGS = [
    j for j, joint in enumerate(JOINTS) if kind(joint) in ("femur", "tibia", "foot")
]
# largest MPJPE of a right track, and smallest of a wrong one
RIGHT_MM = 65.0
WRONG_MM = 75.0
# Signs whose limits are chosen on half of the bodies, and the factors that are tried.
CHOSEN = ("training_mm", "frontal", "acceleration", "unknown", "lost")
FACTORS = (0.7, 1.0, 1.4, 2.0)
WRONG_GOOD = 0.02  # share of the wrong tracks that may be good
# turn of one thigh; share by which a cycle runs faster and slower
LIMP_DEGREES = 7.0
LIMP_WARP = 0.15
# The most that people who stand upright bend their knees. Those of the library, whose
# joints are of a skeleton that was fitted to markers, bend them by 8 degrees or more.
STRAIGHT_DEGREES = 5.0


class Act(NamedTuple):
    """An action: frames of a clip, the person's direction, and whether they walk.

    `degrees` is measured from the direction of the first camera.
    """

    clip: str
    degrees: float
    walks: bool = False
    start: int = 0


ACTS: Mapping[str, Sequence[Act]] = {
    "through": [
        Act(clip, 90.0, True)
        for clip in ("02_01", "05_01", "09_12", "16_16", "16_22", "29_01", "49_01")
    ],
    "towards": [Act(clip, 15.0, True) for clip in ("02_01", "16_16", "49_01")],
    "away": [Act(clip, 180.0, True) for clip in ("05_01", "16_22", "29_01")],
    "aslant": [Act(clip, 45.0, True) for clip in ("16_16", "09_12", "49_01")],
    "waves": [
        Act("29_05", 20.0, start=60),
        Act("14_05", 0.0, start=40),
        Act("02_06", 30.0),
    ],
    "squats": [Act("02_06", 40.0, start=180), Act("14_06", 60.0), Act("14_20", 20.0)],
    "turns": [
        Act("29_01", 60.0, start=100),
        Act("09_12", 30.0, start=200),
        Act("17_03", 80.0),
    ],
}
# people who stand upright, all library clips with nearly straight knees for 40 frames
UPRIGHT = [
    Act("02_05", 0.0, start=424),
    Act("02_10", 10.0, start=380),
    Act("29_04", -10.0, start=437),
    Act("29_08", 0.0, start=498),
    Act("29_24", 15.0, start=548),
    Act("49_09", 0.0, start=100),
    Act("49_12", -15.0),
    Act("49_17", 10.0),
]
# films of people with legs of published shapes: body 0 has the first, and so on
WITH_LEGS = (
    ("through", 0),
    ("through", 3),
    ("aslant", 0),
    ("through", 1),
    ("squats", 0),
    ("through", 6),
    ("towards", 0),
    ("aslant", 2),
)
LIMPS = [
    Act(clip, 90.0, True) for clip in ("02_01", "05_01", "16_16", "16_22", "49_01")
]


class Shot(NamedTuple):
    """One film: its situation, act, number of cameras and body."""

    situation: str
    number: int
    views: int
    body: int
    landmarks: bool = False
    seed: int = 0  # seed of the track
    legs: bool = False  # whether the legs have published shapes

    @property
    def name(self) -> str:
        """The name of its row and its file."""
        marks = "-landmarks" if self.landmarks else ""
        marks += "-legs" if self.legs else ""
        again = f"-seed-{self.seed}" if self.seed else ""
        return f"{self.situation}-{self.number}-{self.views}-{self.body}{marks}{again}"


def shots_with_legs() -> list[Shot]:
    """Return the films of people with legs of published shapes.

    Those who stand upright, each in two bodies, are filmed by one camera, with
    landmarks, which show whether they face it; the others are filmed by one, two and
    four.
    """
    several = [
        Shot(situation, number, views, body, legs=True)
        for views in PLACES
        for body, (situation, number) in enumerate(WITH_LEGS)
    ]
    upright = [
        Shot("upright", number, 1, (number + off) % BODIES, landmarks=True, legs=True)
        for off in (0, BODIES // 2)
        for number in range(len(UPRIGHT))
    ]
    return [*several, *upright]


def shots() -> list[Shot]:
    """Return all films; bodies take turns.

    Films by several cameras have no landmarks, as by default.
    """
    listed = []
    body = 0
    for again in range(2):
        for situation, acts in [*ACTS.items(), *([] if again else [("limp", LIMPS)])]:
            for number in range(len(acts)):
                for views in (1, 2) if situation == "limp" else PLACES:
                    listed.append(
                        Shot(
                            situation,
                            number,
                            views,
                            (body + again) % BODIES,
                            views == 1 and again == 0,
                        )
                    )
                body += 1
    # shuffled, so that the first films include all kinds
    order = np.random.default_rng(62).permutation(len(listed))
    listed = [listed[k] for k in order]
    first = [shot for shot in listed if shot.situation != "limp"][:SEVERAL]
    return [
        *listed[:SOONER],
        *(shot._replace(seed=seed) for seed in range(1, SEEDS) for shot in first),
        *listed[SOONER:],
    ]


@dataclass(frozen=True, eq=False)
class Person:
    """A motion with the true joints, and the filmed body with flesh off the joints."""

    motion: Motion
    body: Body
    flesh: Body = field(repr=False)
    root_off: Array  # (3,) of the flesh's root, in the pelvis's frame
    legs: Legs | None = None  # of published shapes, or None for the flesh's cones

    @property
    def flesh_joints(self) -> Array:
        """The joints (T, 27, 3) of the flesh, which are all that masks can show."""
        return replace(self.motion, skeleton=self.flesh.skeleton).joints

    def mask(self, camera: Camera, k: int) -> Any:
        """Return the true mask of a frame."""
        pose = self.motion.poses[k]
        place = (
            self.motion.translations[k]
            + rotation_from_root_angles(pose[:3]) @ self.root_off
        )
        if self.legs is not None:
            return painted(self.flesh, self.legs, camera, pose, place)
        return project(self.flesh, camera, pose, place)


def body_of(number: int, legs: bool = False) -> tuple[Body, Body, Array]:
    """Return a body, its flesh as a separate body, and the flesh's root offset (3,).

    With `legs`, thighs and shanks vary about the published lengths, not the tracker's.
    """
    rng = np.random.default_rng([62, number])
    average = Body.of(built_in.average_skeleton())
    logs = np.zeros(len(NAMES))
    if legs:
        for part, bone in (("thighs", "femur"), ("shanks", "tibia")):
            share = average.skeleton.lengths[BONES.index(f"l{bone}")] / average.stature
            logs[NAMES.index(f"{part} length")] = np.log(PUBLISHED[bone] / share)
    lengths = slice(1, 1 + len(LENGTHS))
    logs[0] = STATURE * rng.standard_normal()
    logs[lengths] += rng.multivariate_normal(
        np.zeros(len(LENGTHS)), COVARIANCE[lengths, lengths]
    )
    girths = 1.0 + rng.uniform(-GIRTH, GIRTH, len(BONES))
    height = average.stature * np.exp(logs[0])
    body = shaped(average, np.exp(logs), height).scaled(
        1.0, 0.5 * (girths + girths[MIRRORED])
    )
    off = np.zeros((len(JOINTS), 3))
    for name, spread in OFFSETS.items():
        right = rng.standard_normal(3) * spread
        for prefix, sign in (
            (("", 1.0),) if name in JOINTS else (("l", 1.0), ("r", -1.0))
        ):
            off[JOINTS.index(prefix + name)] = right * [sign, 1.0, 1.0]
    bones = np.vstack([np.zeros(3), body.skeleton.offsets])
    ends = [
        [j, *(k for k, parent in enumerate(PARENTS) if parent == j)]
        for j in range(len(JOINTS))
    ]
    # flesh turns around the joints: it moves across the longest bone, not along it
    for joint in range(len(JOINTS)):
        longest = max((bones[k] for k in ends[joint]), key=np.linalg.norm)
        along = longest / np.linalg.norm(longest)
        off[joint] -= (off[joint] @ along) * along
    for joint, parent in enumerate(PARENTS):
        # hands, toes and the head move with their parents
        if joint and not off[joint].any():
            off[joint] = off[parent]
    flesh = body.skeleton.offsets + off[1:] - off[np.array(PARENTS[1:])]
    return body, replace(body, skeleton=replace(body.skeleton, offsets=flesh)), off[0]


def person(shot: Shot) -> Person:
    """Return the filmed person."""
    situations = {**ACTS, "limp": LIMPS, "upright": UPRIGHT}
    act = situations[shot.situation][shot.number]
    body, flesh, root_off = body_of(shot.body, shot.legs)
    motion = frames_of(act.clip, act.start, None if act.walks else act.start + LONGEST)
    if act.walks:
        motion = walked_on(motion, WALK_METRES + 2.2 * (shot.situation == "limp"))
    if shot.situation == "limp":
        motion = limping(motion, shot.body)
    if shot.situation == "upright":
        motion = straightened(motion)
    leg = [BONES.index(name) for name in ("lfemur", "ltibia")]
    scale = body.skeleton.lengths[leg].sum() / motion.skeleton.lengths[leg].sum()
    motion = replace(motion.about_axes_of(body.skeleton), skeleton=body.skeleton)
    motion = replace(motion, translations=scale * motion.translations)
    turn = np.radians(act.degrees) - (
        heading(motion) if act.walks else motion.poses[0, 0]
    )
    motion = on_ground(
        facing_elsewhere(motion.frames(0, min(len(motion), 3 * LONGEST)), turn), body
    )
    legs = legs_of(shot.body, body.stature) if shot.legs else None
    return Person(moved(motion, -middle_of(motion)), body, flesh, root_off, legs)


def limping(motion: Motion, number: int) -> Motion:
    """Return a limping walk.

    One thigh is turned back, so that its steps are shorter, and time runs unevenly.
    """
    short = SIDES[number % 2]
    strikes = [
        motion.fps * step.strike_seconds
        for step in gait_of(motion).steps
        if step.foot == short
    ]
    poses = turned_back(motion, f"{short[0]}femur", np.full(len(motion), LIMP_DEGREES))
    turns = 2.0 * np.pi / float(np.diff(strikes).mean())
    times = np.arange(len(motion))
    uneven = np.clip(
        times + LIMP_WARP / turns * np.cos(turns * (times - strikes[0])),
        0.0,
        len(motion) - 1.0,
    )
    places = at_frames(motion.translations, uneven)
    return replace(
        motion, poses=at_frames(np.unwrap(poses, axis=0), uneven), translations=places
    )


def turned_back(motion: Motion, bone: str, degrees: Array) -> Array:
    """Return the poses (T, 66) of a motion with a bone turned back by angles (T,)."""
    joint = JOINTS.index(bone)
    poses = motion.poses.copy()
    axes = motion.skeleton.axes[joint - 1]
    start = angle_index(joint)
    back = np.array(
        [cv2.Rodrigues(np.array([x, 0.0, 0.0]))[0] for x in np.radians(degrees)]
    )
    turned = axes.T @ back @ motion.skeleton.turns(poses)[joint] @ axes
    poses[:, start : start + 3] = joint_angles_from_rotation(turned)
    return poses


def straightened(motion: Motion) -> Motion:
    """Return a motion whose knees are never bent by more than `STRAIGHT_DEGREES`.

    Hips and ankles turn by half, so that the feet stay under the hips, and flat.
    """
    angles = clinical_angles(motion.skeleton, motion.poses)
    for side in SIDES:
        less = np.minimum(STRAIGHT_DEGREES - angles[f"{side}_knee_flexion"], 0.0)
        for bone, share in (("femur", -0.5), ("tibia", 1.0), ("foot", -0.5)):
            poses = turned_back(motion, f"{side[0]}{bone}", share * less)
            motion = replace(motion, poses=poses)
    return motion


def cameras_of(
    shot: Shot, rng: np.random.Generator
) -> tuple[list[Camera], list[Camera]]:
    """Return the cameras, and their calibrations."""
    target = np.array([0.0, HEIGHT, 0.0])
    size = SMALL if shot.legs else SIZE
    turned = rng.uniform(-15.0, 15.0)
    true = [
        Camera.around(target, np.radians(degrees + turned), DISTANCE, size, ACROSS)
        for degrees in PLACES[shot.views]
    ]
    rotation_off, place_off, focal_off = CALIBRATION_OFF
    calibrated = []
    for camera in true:
        centre = (
            -camera.rotation.T @ camera.translation + place_off * rng.standard_normal(3)
        )
        rotation = (
            cv2.Rodrigues(rotation_off * rng.standard_normal(3))[0] @ camera.rotation
        )
        focal = camera.focal * (1.0 + focal_off * rng.standard_normal())
        calibrated.append(
            replace(
                camera, focal=focal, rotation=rotation, translation=-rotation @ centre
            )
        )
    return true, calibrated


def damaged(mask: Any, shadow: int | None, rim: float, rng: np.random.Generator) -> Any:
    """Return a mask with a segmenter's damage; `shadow` is the seed of a shadow."""
    if not mask.any():
        return mask
    if shadow is not None:
        mask = corrupted(mask, {"shadow": SHADOW}, np.random.default_rng(shadow))
    return corrupted(wandering(mask, rim, ROUGH, 2.0, rng), DAMAGE, rng)


def landmarks_of(motion: Motion, camera: Camera, rng: np.random.Generator) -> Array:
    """Return landmarks (T, 27, 3) that sometimes exchange left and right."""
    off = LANDMARK_OFF * (
        rng.standard_normal((len(JOINTS), 3))
        + rng.standard_normal((len(motion), len(JOINTS), 3))
    )
    joints = motion.joints + off
    share = EXCHANGED[rng.integers(len(EXCHANGED))]
    for group in GROUPS[:2]:
        exchanged = np.zeros(len(motion), dtype=bool)
        now = False
        for k in range(len(motion)):
            leave = 1.0 / EXCHANGE_FRAMES
            # so that a share of the frames is exchanged in the long run
            enter = leave * share / (1.0 - share)
            chance = rng.random()
            now = chance >= leave if now else chance < enter
            exchanged[k] = now
        joints[np.ix_(exchanged, group)] = joints[np.ix_(exchanged, OTHER_SIDE[group])]
    known = np.isin(np.arange(len(JOINTS)), np.concatenate(GROUPS))
    pixels = np.stack([camera.project(each)[0] for each in joints])
    return np.concatenate(
        [pixels, np.tile(0.9 * known[None, :, None], (len(motion), 1, 1))], axis=2
    )


def measured(folder: Path, shot: Shot) -> dict[str, Any]:
    """Return the row of a film, which is made, tracked, and stored in a folder."""
    who = person(shot)
    rng = np.random.default_rng(
        [shot.body, shot.views, shot.number, *shot.situation.encode()]
    )
    true, calibrated = cameras_of(shot, rng)
    paths = []
    for number, camera in enumerate(true):
        rim = RIM * rng.standard_normal()
        shadow = int(rng.integers(1000)) if rng.random() < 0.5 else None
        masks = [
            damaged(who.mask(camera, k), shadow, rim, rng)
            for k in range(len(who.motion))
        ]
        marks: dict[str, Any] = {}
        if shot.landmarks:
            marks = {"landmarks": landmarks_of(who.motion, camera, rng)}
        paths.append(folder / f"{shot.name}-{number}.npz")
        np.savez_compressed(
            paths[-1], masks=np.array(masks), fps=np.array(who.motion.fps), **marks
        )
    row: dict[str, Any] = {
        **shot._asdict(),
        "name": shot.name,
        "frames": len(who.motion),
    }
    try:
        result = track(
            paths if len(paths) > 1 else paths[0],
            camera=calibrated,
            height=who.body.stature,
            train=[
                recorded.leaving_out(
                    recorded.LIBRARY, [who.motion.name.partition("_")[0]]
                )
            ],
            seed=shot.seed,
            progress=QUIET,
        )
    except ValueError as error:
        return row | {"refused": str(error)}
    finally:
        for path in paths:
            path.unlink()
    row |= figures(result, who)
    if not shot.seed:
        keep(folder / f"{shot.name}.npz", result, who)
    return row


def figures(result: Track, who: Person) -> dict[str, Any]:
    """Return the figures of a track."""
    true = who.motion.joints
    joints = result.motion.joints
    mpjpe = metrics.mpjpe_mm(true, joints)
    swapped = legs_exchanged(true, joints)
    known = result.table["unknown_sides"] == 0.0
    lengths = [motion.skeleton.lengths for motion in (who.motion, result.motion)]
    angles = clinical_angles(result.motion.skeleton, result.motion.poses)
    assert result.trust is not None
    return {
        "mpjpe_mm": float(mpjpe.mean()),
        "flesh_mm": float(metrics.mpjpe_mm(true, who.flesh_joints).mean()),
        "lost": float((mpjpe > LOST_MM).mean()),
        "exchanged": float(swapped.mean()),
        "unknown": float(1.0 - known.mean()),
        "known_exchanged": float((swapped & known).mean()),
        "iou": result.measures.iou,
        "lengths": {
            name: float(lengths[1][bone] / lengths[0][bone] - 1.0)
            for name, bone in SEGMENTS.items()
        },
        "build": result.log.build,
        "degrees": angle_errors(who.motion, angles, np.ones(len(true), dtype=bool)),
        "bent": bent_beyond(who.motion, angles),
        "trust": {
            name: value
            for name, value in vars(result.trust).items()
            if name != "unknown_signs"
        },
        "gait": [steps_of(gait_of(who.motion)), steps_of(result.gait)],
    }


def bent_beyond(true: Motion, angles: Mapping[str, Array]) -> list[float]:
    """Return median and 90th percentile, in degrees, of knee flexion beyond the truth.

    Of each frame, the mean of both knees counts.
    """
    known = clinical_angles(true.skeleton, true.poses)
    knees = [f"{side}_knee_flexion" for side in SIDES]
    beyond = np.mean([angles[knee] - known[knee] for knee in knees], axis=0)
    return [float(quantile) for quantile in np.quantile(beyond, (0.5, 0.9))]


def legs_exchanged(true: Array, joints: Array) -> Array:
    """Return the frames (T,) in which left and right legs are exchanged.

    There the legs of joints (T, 27, 3) are nearer to the truth's opposite legs.
    """
    here = joints - joints[:, :1]
    there = true - true[:, :1]
    other = np.array(OTHER_SIDE)[LEGS]
    off, exchanged = (
        np.linalg.norm(there[:, LEGS] - here[:, legs], axis=2).mean(axis=1)
        for legs in (LEGS, other)
    )
    return np.asarray(exchanged < off)


def steps_of(gait: Gait) -> dict[str, float | None]:
    """Return the lengths and times of left and right steps."""
    feet = {"left": gait.left, "right": gait.right}
    names = ("step_length", "step_seconds")
    return {
        f"{side} {name}": getattr(foot, name)
        for side, foot in feet.items()
        for name in names
    }


def keep(path: Path, result: Track, who: Person) -> None:
    """Write the data from which intervals are learned."""
    motion = result.motion
    posteriors = [
        frame.posterior for frame in result.frames if frame.posterior is not None
    ]
    samples = motion.skeleton.joints(
        np.array([posterior.poses for posterior in posteriors])
    )
    models = [posterior.recalibration or Recalibration() for posterior in posteriors]
    # take off the shared spreads, which this study taught
    spreads = np.array([model.joint_spreads for model in models])
    spreads = np.sqrt(
        np.maximum(spreads**2 - shared_spreads(len(result.scene.cameras)) ** 2, 0.0)
    )
    np.savez_compressed(
        path,
        true=who.motion.joints.astype(np.float32),
        joints=motion.joints.astype(np.float32),
        distances=joint_distances(samples, motion.joints[:, None]).astype(np.float32),
        weights=np.array([posterior.weights for posterior in posteriors]),
        spreads=spreads,
        factors=np.array([model.joint_factors for model in models]),
        depths=result.scene.cameras[0].project(motion.translations)[1],
        true_depths=result.scene.cameras[0].project(who.motion.translations)[1],
    )


class Film(NamedTuple):
    """A film's results.

    `held` has the shares of each joint within its intervals: (body or world, grid,
    levels, 27).
    """

    body: int
    views: int
    held: Array
    depths_off: Array  # (T,) relative errors of depth


def film_of(folder: Path, row: Mapping[str, Any]) -> Film:
    """Return how often a stored track's intervals hold, for each shared error."""
    with np.load(folder / f"{row['name']}.npz") as stored:
        kept = {name: stored[name][::STRIDE].astype(np.float64) for name in stored}
    off = (
        joint_distances(kept["true"], kept["joints"]),
        np.linalg.norm(kept["true"] - kept["joints"], axis=2),
    )
    far = (
        DEPTH
        * (row["views"] == 1)
        * kept["depths"][:, None, None]
        * ndtri(0.5 + 0.5 * np.array(LEVELS))[:, None]
    )
    held = np.empty((2, len(GRID), len(LEVELS), len(JOINTS)))
    arrays = [kept[name] for name in ("distances", "weights", "spreads", "factors")]
    for k, shared in enumerate(GRID):
        frames = zip(*arrays, strict=True)
        radii = np.array(
            [
                f * quantiles(away, weights, np.hypot(spread, shared), 3)
                for away, weights, spread, f in frames
            ]
        )
        for where, widened in enumerate((radii, np.hypot(radii, far))):
            held[where, k] = (off[where][:, None] <= widened).mean(axis=0)
    return Film(
        row["body"], row["views"], held, kept["depths"] / kept["true_depths"] - 1.0
    )


def least_shared(films: Sequence[Film], where: int, joints: Sequence[int]) -> int:
    """Return the index in the grid of the smallest sufficient shared error.

    With it, 80 % intervals of some joints hold in 80 % of the frames.
    """
    held = np.mean(
        [film.held[where, :, MAIN_LEVEL][:, joints] for film in films], axis=(0, 2)
    )
    enough = np.flatnonzero(held >= LEVELS[MAIN_LEVEL])
    return int(enough[0]) if len(enough) else len(GRID) - 1


def intervals_lines(films: Sequence[Film]) -> Iterator[str]:
    """Yield what all films teach, and how often intervals hold for each body.

    A body's intervals are learned from films of the others.
    """
    alone = np.abs(
        np.concatenate([film.depths_off for film in films if film.views == 1])
    )
    level = LEVELS[MAIN_LEVEL]
    spread = np.quantile(alone, level) / ndtri(0.5 + 0.5 * level)
    yield f"depth by one camera: {spread:.3f}"
    yield ""
    heads = [
        "cameras",
        "in the",
        *(f"{100 * level:.0f} %" for level in LEVELS),
        *(f"80 % of {part}" for part in PARTS),
    ]
    cells = []
    unwidened = []
    for views, (where, name) in product(PLACES, enumerate(("body", "world"))):
        some = [film for film in films if film.views == views]
        taught = {
            part: int(1e3 * GRID[least_shared(some, where, joints)])
            for part, joints in JOINTS_OF.items()
        }
        yield f"{views} cameras, in the {name}, mm: {taught}"
        held = np.empty((len(some), len(LEVELS), len(JOINTS)))
        for film, shares in zip(some, held, strict=True):
            others = [other for other in some if other.body != film.body]
            for joints in JOINTS_OF.values():
                shares[:, joints] = film.held[
                    where, least_shared(others, where, joints)
                ][:, joints]
        parts = [
            percent(float(held[:, MAIN_LEVEL, joints].mean()), 0)
            for joints in JOINTS_OF.values()
        ]
        cells.append(
            [
                str(views),
                name,
                *(percent(float(x), 0) for x in held[..., 1:].mean(axis=(0, 2))),
                *parts,
            ]
        )
        bare = np.mean([film.held[where, 0, :, 1:] for film in some], axis=(0, 2))
        unwidened.append([str(views), name, *(percent(float(x), 0) for x in bare)])
    yield ""
    yield from markdown(heads, cells, 2)
    yield ""
    yield from markdown([*heads[: 2 + len(LEVELS)]], unwidened, 2)


def accuracy_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield errors of joints, angles and lengths by the number of cameras.

    Angles are of walks `through`.
    """
    heads = ["cameras", "films", "MPJPE mm", "through", "of the flesh itself"]
    heads += [f"{name.replace('_', ' ')}, degrees" for name in SAGITTAL]
    heads += [*(f"{name} %" for name in SEGMENTS), "known and exchanged %"]
    cells = []
    for views in PLACES:
        some = [row for row in rows if row["views"] == views]
        through = [row for row in some if row["situation"] == "through"]
        lengths_off = [
            100.0 * np.mean([abs(row["lengths"][name]) for row in some])
            for name in SEGMENTS
        ]
        cells.append(
            [
                str(views),
                str(len(some)),
                f"{np.median([row['mpjpe_mm'] for row in some]):.0f}",
                *(
                    f"{np.median([row[name] for row in through]):.0f}"
                    for name in ("mpjpe_mm", "flesh_mm")
                ),
                *(
                    f"{np.median([row['degrees'][name] for row in through]):.1f}"
                    for name in SAGITTAL
                ),
                *(f"{percent_off:.1f}" for percent_off in lengths_off),
                percent(float(np.mean([row["known_exchanged"] for row in some])), 1),
            ]
        )
    yield from markdown(heads, cells, 1)


class Limits(NamedTuple):
    """From where on signs make a track doubtful, and how many make it unusable."""

    doubtful: Mapping[str, float]
    together: int

    def grade(self, figures: Mapping[str, Any]) -> Grade:
        """Return the grade of a track by the figures of its signs."""
        signs = {}
        for name, doubtful in self.doubtful.items():
            best, _, unusable = trust.SIGNS[name].limits or (0.0, 0.0, 0.0)
            limits = (best, doubtful, max(unusable, 1.01 * doubtful))
            signs[name] = replace(trust.SIGNS[name], limits=limits)
        with (
            patch.dict(trust.SIGNS, signs),
            patch.object(trust, "UNUSABLE_TOGETHER", self.together),
        ):
            return trust.grade_of(trust.signs_against(figures))


class Verdicts(NamedTuple):
    """The grades of right and of wrong tracks."""

    right: Sequence[Grade]
    wrong: Sequence[Grade]

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, Any]], limits: Limits) -> Self:
        """Return the grades of tracks that are right or wrong, by some limits."""
        right = []
        wrong = []
        for row in rows:
            if row["mpjpe_mm"] <= RIGHT_MM:
                right.append(limits.grade(row["trust"]))
            elif row["mpjpe_mm"] >= WRONG_MM:
                wrong.append(limits.grade(row["trust"]))
        return cls(right, wrong)

    @property
    def value(self) -> tuple[int, int]:
        """How good the limits are: right tracks are good, and only wrong ones unused.

        Limits with which more than `WRONG_GOOD` of the wrong tracks are good come last.
        """
        if self.wrong.count("good") > WRONG_GOOD * len(self.wrong):
            return -1, 0
        unused = self.wrong.count("do not use") - self.right.count("do not use")
        return self.right.count("good"), unused

    @property
    def cells(self) -> list[str]:
        """The cells of a row of a table."""
        cells = []
        for grade in ("good", "do not use"):
            for grades in (self.right, self.wrong):
                cells.append(f"{grades.count(grade)} of {len(grades)}")
        return cells


def present_limits() -> Limits:
    """Return the limits of `posefit.evaluation.trust`."""
    doubtful = {}
    for name in CHOSEN:
        limits = trust.SIGNS[name].limits
        assert limits is not None
        doubtful[name] = limits[1]
    return Limits(doubtful, trust.UNUSABLE_TOGETHER)


def chosen_limits(rows: Sequence[Mapping[str, Any]]) -> Limits:
    """Return the best limits for some tracks; of equally good ones, the present ones.

    Of others that are equally good, it is those nearest to the present ones.
    """
    present = present_limits()
    tried = []
    for factors in product(FACTORS, repeat=len(CHOSEN)):
        pairs = zip(present.doubtful.items(), factors, strict=True)
        doubtful = {name: limit * factor for (name, limit), factor in pairs}
        far = float(np.abs(np.log(factors)).sum())
        for together in (present.together, present.together - 1):
            limits = Limits(doubtful, together)
            away = far + abs(together - present.together)
            tried.append((Verdicts.of(rows, limits).value, -away, limits))
    return max(tried, key=lambda value_away_limits: value_away_limits[:2])[2]


def verdict_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield how many right and wrong tracks have the grades good and do not use.

    There is a row for each number of cameras, and for odd and even bodies: with the
    present limits, and with those that are chosen on the other half of the bodies.
    """
    halves = [[row for row in rows if row["body"] % 2 == odd] for odd in (0, 1)]
    chosen = [chosen_limits(half) for half in halves]
    names = ("even", "odd")
    for name, limits in zip(names, chosen, strict=True):
        texts = [f"{sign} {limit:.3g}" for sign, limit in limits.doubtful.items()]
        yield (
            f"chosen on {name} bodies: doubtful from {', '.join(texts)}; "
            f"{limits.together} together make a track unusable"
        )
    yield ""
    heads = ["limits", "cameras", "bodies", "right: good", "wrong: good"]
    heads += ["right: do not use", "wrong: do not use"]
    present = present_limits()
    cells = []
    for which, views, odd in product(("present", "chosen"), PLACES, (0, 1)):
        some = [row for row in halves[odd] if row["views"] == views]
        limits = present if which == "present" else chosen[1 - odd]
        cells.append([which, str(views), names[odd], *Verdicts.of(some, limits).cells])
    yield from markdown(heads, cells, 3)


def seeds_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield how much the MPJPE of films differs between seeds of the track."""
    films: dict[str, list[float]] = {}
    for row in rows:
        films.setdefault(row["name"].partition("-seed-")[0], []).append(row["mpjpe_mm"])
    cells = [
        [
            name,
            str(len(mpjpe)),
            f"{min(mpjpe):.0f} to {max(mpjpe):.0f}",
            f"{np.std(mpjpe, ddof=1):.1f}",
        ]
        for name, mpjpe in films.items()
        if len(mpjpe) > 1
    ]
    yield from markdown(["film", "seeds", "MPJPE mm", "standard deviation"], cells, 1)


def limps_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield left and right steps of limps, true and measured."""
    heads = [
        "limp",
        "cameras",
        "left, right m: true",
        "measured",
        "left, right s: true",
        "measured",
    ]
    cells = []
    for row in rows:
        steps = [
            [gait[f"{side} {name}"] for side in SIDES]
            for name in ("step_length", "step_seconds")
            for gait in row["gait"]
        ]
        cells.append(
            [
                row["name"],
                str(row["views"]),
                *(
                    ", ".join("-" if x is None else f"{x:.2f}" for x in each)
                    for each in steps
                ),
            ]
        )
    yield from markdown(heads, cells, 2)


def legs_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield errors of the legs, of walks and others and of people who stand upright.

    Beside the mean errors of lengths are those without sign. The error of the flesh is
    what remains if a body fits the flesh exactly; in thighs and shanks, it does not
    count how far that is behind the bones. Of knees bent beyond the
    truth there are the median and the 90th percentile of a film's frames, the medians
    of the films, and those of the worst film in ten.
    """
    heads = ["films", "cameras", "number", "MPJPE mm", "of the flesh itself"]
    heads += ["thigh, shank, ratio %"]
    heads += ["without sign %", "knees beyond the truth, degrees", "of the worst"]
    cells = []
    for upright, views in [*product((False,), PLACES), (True, 1)]:
        some = [
            row
            for row in rows
            if (row["situation"] == "upright", row["views"]) == (upright, views)
        ]
        if not some:
            continue
        off = 100.0 * np.log1p(
            [[row["lengths"][name] for name in ("thigh", "shank")] for row in some]
        )
        off = np.column_stack([off, off[:, 0] - off[:, 1]])
        bent = np.array([row["bent"] for row in some])
        middle, worst = np.quantile(bent, (0.5, 0.9), axis=0)
        cells.append(
            [
                "upright" if upright else "others",
                str(views),
                str(len(some)),
                f"{np.median([row['mpjpe_mm'] for row in some]):.0f}",
                f"{np.median([row['flesh_mm'] for row in some]):.0f}",
                ", ".join(f"{x:.1f}" for x in off.mean(axis=0)),
                ", ".join(f"{x:.1f}" for x in np.abs(off).mean(axis=0)),
                ", ".join(f"{x:.0f}" for x in middle),
                ", ".join(f"{x:.0f}" for x in worst),
            ]
        )
    yield from markdown(heads, cells, 2)


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--legs", is_flag=True, help="Film people with legs of published shapes instead."
)
@click.option(
    "--report", is_flag=True, help="Print the report of the folder; track nothing."
)
@WORKERS
def main(folder: Path, legs: bool, report: bool, workers: int | None) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows = folder / ("legs.jsonl" if legs else "rows.jsonl")
    wanted = shots_with_legs() if legs else shots()
    done = earlier(str(rows), lambda row: row["name"])
    if not report:
        jobs = {
            shot.name: partial(measured, folder, shot)
            for shot in wanted
            if shot.name not in done
        }
        done |= each(jobs, workers, partial(kept, str(rows))) if jobs else {}
    tracked = [row for row in done.values() if "refused" not in row]
    films = [row for row in tracked if not row["seed"]]
    if legs:
        for line in legs_lines(films):
            click.echo(line)
        return
    click.echo(
        f"{len(films)} of {len(shots()) - SEVERAL * (SEEDS - 1)} films were tracked"
    )
    with_legs = earlier(str(folder / "legs.jsonl"), lambda row: row["name"])
    judged = [row for row in with_legs.values() if "refused" not in row]
    for lines in (
        intervals_lines([film_of(folder, row) for row in films]),
        accuracy_lines(films),
        verdict_lines([*films, *judged]),
        seeds_lines(tracked),
        limps_lines([row for row in films if row["situation"] == "limp"]),
    ):
        click.echo("\n".join([*lines, ""]))


if __name__ == "__main__":
    main()
