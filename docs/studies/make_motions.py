"""Fits the built-in motions: `python docs/studies/make_motions.py CMU_DIR`.

The average skeleton is made from the same files. A motion is a period and a Fourier
series over it, for each free angle and the root's path. Only these few numbers are
stored, and no recorded frame. Run it by hand when a motion is added. The package
contains its result, built_in.json. CMU_DIR is by default the environment variable
POSEFIT_CMU.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    rotation_from_joint_angles,
)
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    INNER,
    JOINTS,
    MIRROR,
    Skeleton,
    angle_index,
)
from posefit.motion import built_in
from posefit.motion.amc import read_clip
from posefit.motion.asf import parse_asf
from posefit.motion.built_in import activity_of

PHASES = 48  # phases of a cycle for which the arms are computed
SWING = np.radians(28.0)  # swing of a waving forearm, to either side of upright
WAVES = 2  # per cycle
BOB = np.radians(5.0)  # outstretched arms sink and rise once per cycle


def held_out(phases: Array, side: float) -> tuple[Array, Array]:
    """Return the directions (n, 3) of upper arm and forearm of an outstretched arm.

    `side` is 1 for the left arm and -1 for the right.
    """
    lift = -0.05 + np.sin(BOB) * side * np.cos(2.0 * np.pi * phases)
    flat = np.full(len(phases), side)
    return np.column_stack([flat, lift, 0.05 + 0.0 * flat]), np.column_stack(
        [flat, lift + 0.1, 0.25 + 0.0 * flat]
    )


def waving(phases: Array, side: float) -> tuple[Array, Array]:
    """Return the directions (n, 3) of upper arm and forearm of a waving arm."""
    swing = SWING * np.sin(2.0 * np.pi * WAVES * phases)
    flat = np.full(len(phases), side)
    upper = np.column_stack([flat, -0.15 + 0.0 * flat, 0.2 + 0.0 * flat])
    return upper, np.column_stack(
        [side * np.sin(swing) + 0.1 * side, np.cos(swing), 0.15 + 0.0 * flat]
    )


def drawn(
    skeleton: Skeleton, side: str, upper: Array, fore: Array
) -> tuple[list[int], Array]:
    """Return an arm's angles (n, 4) for given directions, and their places in a pose.

    Each pose starts from the one before, so that the angles change smoothly.
    """
    shoulder, elbow, wrist = (
        JOINTS.index(side + name) for name in ("clavicle", "humerus", "radius")
    )
    first = angle_index(elbow)
    bend = angle_index(wrist)
    places = [first, first + 1, first + 2, bend]

    def residual(angles: Array, upper: Array, fore: Array, before: Array) -> Array:
        pose = np.zeros((1, ANGLES))
        pose[0, places] = angles
        joints = skeleton.joints(pose)[0]
        ways = (
            (joints[elbow] - joints[shoulder], upper),
            (joints[wrist] - joints[elbow], fore),
        )
        off = [
            way / np.linalg.norm(way) - wanted / np.linalg.norm(wanted)
            for way, wanted in ways
        ]
        return np.concatenate([*off, 0.02 * (angles - before)])

    solutions = np.zeros((len(upper), 4))
    guess = np.radians([0.0, 0.0, 0.0, 40.0])
    for k in range(len(upper)):
        guess = np.asarray(
            least_squares(residual, guess, args=(upper[k], fore[k], guess)).x
        )
        solutions[k] = guess
    return places, solutions


ORIGIN = (
    "Fitted to motions of mocap.cs.cmu.edu. "
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)
HARMONICS = 5
DIGITS = 5  # decimals of radians and metres
SUBJECTS = ("02", "05", "09", "13", "14", "16", "17", "49", "127")


class Clip(NamedTuple):
    """The source of a style: the steady part of a clip, and the range of its period.

    The shortest and the longest possible period are in seconds.
    """

    path: str
    start: int
    stop: int | None
    shortest: float
    longest: float


# 127_03 is not used: it starts from standing and accelerates to its last frame, so that
# no part is periodic.
CLIPS = {
    "walk-a": Clip("16/16_15", 2, None, 0.9, 1.35),
    "walk-b": Clip("02/02_01", 0, None, 0.9, 1.35),
    "walk-c": Clip("05/05_01", 0, 380, 0.9, 1.35),
    "run-a": Clip("16/16_35", 0, None, 0.6, 0.95),
    "run-b": Clip("09/09_01", 0, None, 0.6, 0.95),
    "march-a": Clip("13/13_29", 2700, 3780, 1.8, 3.2),
    "march-b": Clip("14/14_06", 1580, 2330, 1.8, 3.2),
    "jacks-a": Clip("13/13_29", 20, 440, 0.8, 1.5),
    "jacks-b": Clip("14/14_06", 20, 410, 0.8, 1.5),
    "squat-a": Clip("13/13_29", 3800, 4580, 1.2, 3.3),
    "squat-b": Clip("14/14_06", 1015, 1565, 1.2, 3.3),
    "jump-a": Clip("49/49_02", 130, 400, 0.6, 1.2),
    "jump-b": Clip("16/16_01", 60, 262, 1.6, 1.69),
    "step-a": Clip("05/05_01", 0, 380, 0.9, 1.35),
    "step-b": Clip("16/16_17", 0, 200, 0.9, 1.35),
    "arms-out-a": Clip("02/02_01", 0, None, 0.9, 1.35),
    "arms-out-b": Clip("16/16_17", 0, 200, 0.9, 1.35),
    "wave-a": Clip("05/05_01", 0, 380, 0.9, 1.35),
    "wave-b": Clip("16/16_17", 0, 200, 0.9, 1.35),
}
# Directions of the arms that differ from the clip's, for each side.
ARMS = {"arms-out": {"l": held_out, "r": held_out}, "wave": {"r": waving}}
ON_THE_SPOT = ("step",)  # walks without their progress over the ground
STANDING = 0.2  # m/s; a slower person stays in place and faces their mean heading
# The signal that is highest at phase 0 in each kind of motion: an angle rx, minus
# another one, or minus the root's height.
BEATS = {
    "walk": ("rfemur", "lfemur"),  # rx is negative when the thigh is in front
    "run": ("rfemur", "lfemur"),
    "march": ("rfemur", "lfemur"),
    "jacks": ("lhumerus", None),
    "squat": (None, "root"),
    "jump": (None, "root"),
    "step": ("rfemur", "lfemur"),
    "arms-out": ("rfemur", "lfemur"),
    "wave": ("rfemur", "lfemur"),
}


def basis(phases: Array, harmonics: int) -> Array:
    """Return 1, cosines and sines (T, 1 + 2 harmonics) of phases (T,) in cycles."""
    turns = 2.0 * np.pi * np.outer(phases, np.arange(1, harmonics + 1))
    return np.column_stack([np.ones(len(phases)), np.cos(turns), np.sin(turns)])


def fitted(root: Path, clip: Clip, kind: str) -> dict[str, Any]:
    """Return the model of one style of a kind of motion."""
    folder, name = clip.path.split("/")
    motion = read_clip(root / folder / f"{folder}.asf", root / folder / f"{name}.amc")
    motion = motion.frames(clip.start, clip.stop or len(motion))
    times = np.arange(len(motion)) / motion.fps
    velocity = np.polyfit(times, motion.translations, 1)[0]
    places = motion.translations
    if kind in ON_THE_SPOT:
        places = places - times[:, None] * velocity * [1.0, 0.0, 1.0]
        velocity = np.zeros(3)
    speed = float(np.hypot(velocity[0], velocity[2]))
    heading = np.arctan2(velocity[0], velocity[2])
    if speed < STANDING:
        speed = 0.0
        heading = float(np.angle(np.exp(1j * motion.poses[:, 0]).mean()))
    turn = Rotation.from_euler("y", -heading).as_matrix()
    path = places @ turn.T
    path[:, 2] -= speed * times
    path[:, [0, 2]] -= path[:, [0, 2]].mean(axis=0)
    series = np.column_stack([path, motion.poses])
    series[:, 3] = (series[:, 3] - heading + np.pi) % (2.0 * np.pi) - np.pi
    free = np.flatnonzero(motion.skeleton.free)
    used = series[:, np.concatenate([[0, 1, 2], 3 + free])]

    def residual(period: float) -> tuple[float, Array]:
        columns = basis(times / period, HARMONICS)
        # a little damping: a clip hardly longer than its period leaves the highest
        # harmonics undetermined
        normal = columns.T @ columns + 1e-3 * np.eye(columns.shape[1])
        coefficients: Array = np.linalg.solve(normal, columns.T @ used).astype(
            np.float64
        )
        return float(
            np.abs(used - columns @ coefficients)[:, 3:].sum() / len(used) / 66.0
        ), coefficients

    periods = np.arange(clip.shortest, clip.longest, 0.0025)
    period = float(periods[np.argmin([residual(p)[0] for p in periods])])
    error, coefficients = residual(period)
    coefficients = in_step(coefficients, free, kind)
    return {
        "source": name,
        "period": round(period, 4),
        "speed": round(speed, 4),
        "residual_degrees": round(float(np.degrees(error)), 3),
        "angles": free.tolist(),
        "series": np.round(coefficients.T, DIGITS).tolist(),
    }


def in_step(coefficients: Array, free: NDArray[np.int64], kind: str) -> Array:
    """Return coefficients (1 + 2 H, series) shifted to start at the motion's beat."""

    def series(name: str | None) -> Array:
        if name is None:
            return np.zeros(len(coefficients))
        # the root's height is the second series; the first three are its path
        if name == "root":
            return np.asarray(coefficients[:, 1])
        place = int(np.searchsorted(free, angle_index(JOINTS.index(name))))
        return np.asarray(coefficients[:, 3 + place])

    high, low = BEATS[kind]
    swing = series(high) - series(low)
    shift = np.arctan2(swing[1 + HARMONICS], swing[1])
    turns = shift * np.arange(1, HARMONICS + 1)[:, None]
    cosines = coefficients[1 : 1 + HARMONICS]
    sines = coefficients[1 + HARMONICS :]
    moved = (
        cosines * np.cos(turns) + sines * np.sin(turns),
        sines * np.cos(turns) - cosines * np.sin(turns),
    )
    return np.vstack([coefficients[:1], *moved])


def armed(model: dict[str, Any], skeleton: Skeleton, kind: str) -> None:
    """Give a model of a walk the arms of its kind.

    A trunk that leans and turns a little limits how far they point as they should.
    """
    phases = np.arange(PHASES) / PHASES
    for side, directions in ARMS.get(kind, {}).items():
        places, angles = drawn(
            skeleton, side, *directions(phases, 1.0 if side == "l" else -1.0)
        )
        coefficients = np.linalg.lstsq(basis(phases, HARMONICS), angles, rcond=None)[0]
        for place, series in zip(places, coefficients.T, strict=True):
            model["series"][3 + model["angles"].index(place)] = np.round(
                series, DIGITS
            ).tolist()


def average(skeletons: list[Skeleton]) -> dict[str, Any]:
    """Return the mean of some skeletons and their mirror images."""
    flip = np.diag([-1.0, 1.0, 1.0])
    other = np.array(MIRROR)[1:] - 1
    offsets = np.mean(
        [
            half
            for one in skeletons
            for half in (one.offsets, one.offsets[other] @ flip)
        ],
        axis=0,
    )
    frames = np.array(
        [
            half
            for one in skeletons
            for half in (one.axes, flip @ one.axes[other] @ flip)
        ]
    )
    axes = np.array(
        [
            Rotation.from_matrix(frames[:, bone]).mean().as_matrix()
            for bone in range(len(BONES))
        ]
    )
    inner = {JOINTS[joint] for joint in INNER}
    return {
        "offsets": np.round(offsets, DIGITS).tolist(),
        "axes_degrees": np.round(
            np.degrees(joint_angles_from_rotation(axes)), 4
        ).tolist(),
        "channels": [
            [bone, list(free)] for bone, free in skeletons[0].channels if bone in inner
        ],
        "limits_degrees": limits_degrees(skeletons),
    }


def limits_degrees(skeletons: list[Skeleton]) -> list[list[float]]:
    """Return the widest of the joint limits that the skeletons state."""
    stated = np.array([one.limits for one in skeletons if one.limits is not None])
    low = np.degrees(stated[..., 0].min(axis=0))
    high = np.degrees(stated[..., 1].max(axis=0))
    widest: list[list[float]] = np.round(np.column_stack([low, high]), 4).tolist()
    return widest


def grounded(model: dict[str, Any], skeleton: Skeleton) -> None:
    """Shift a model's root height so that its lowest joint is 3 cm above the ground.

    A toe is as thick as that.
    """
    phases = np.linspace(0.0, 1.0, 120, endpoint=False)
    values = basis(phases, HARMONICS) @ np.array(model["series"]).T
    poses = np.zeros((len(phases), 66))
    poses[:, model["angles"]] = values[:, 3:]
    joints = skeleton.joints(poses, values[:, :3])
    model["series"][1][0] = round(
        model["series"][1][0] + 0.03 - float(joints[..., 1].min()), DIGITS
    )


@click.command(cls=Command)
@click.argument(
    "root", metavar="CMU_DIR", type=click.Path(path_type=Path), envvar="POSEFIT_CMU"
)
def main(root: Path) -> None:
    """Write built_in.json into the package. Raises ValueError if a file is missing."""
    needed = [f"{subject}/{subject}.asf" for subject in SUBJECTS] + [
        f"{clip.path}.amc" for clip in CLIPS.values()
    ]
    for name in needed:
        if not (root / name).is_file():
            raise InputError(f"CMU_DIR must contain {name}, got {root} without it")
    bones = average(
        [parse_asf(root / subject / f"{subject}.asf").skeleton for subject in SUBJECTS]
    )
    skeleton = Skeleton(
        "average",
        np.array(bones["offsets"]),
        rotation_from_joint_angles(np.radians(bones["axes_degrees"])),
        tuple((bone, tuple(free)) for bone, free in bones["channels"]),
        np.radians(bones["limits_degrees"]),
    )
    motions = {
        name: fitted(root, clip, activity_of(name)) for name, clip in CLIPS.items()
    }
    for name, model in motions.items():
        armed(model, skeleton, activity_of(name))
        grounded(model, skeleton)
        print(
            f"{name}: period {model['period']} s, {model['speed']} m/s, "
            f"residual {model['residual_degrees']} degrees"
        )
    target = Path(built_in.__file__).with_name("built_in.json")
    text = json.dumps(
        {"origin": ORIGIN, "skeleton": bones, "motions": motions}, separators=(",", ":")
    )
    target.write_text(text + "\n", encoding="utf-8")
    print(f"{target.name}: {len(text)} bytes")


if __name__ == "__main__":
    main()
