"""Fits VSMM's motion models to clips: `python docs/studies/make_models.py CMU_DIR`.

Interpretations V4 to V7. A model is a ridge regression from the quaternions of a frame
to those of the next. It is fitted in two forms: "zero" as the patent writes it, and
"identity" as ours. Each is stored with its coefficients, the covariance of its
residuals, means of similar poses, and a hundred captured poses. Every clip is also used
mirrored. The errors one and ten frames ahead, on clips that were not used, are printed
and stored with each model, next to the errors of standing still.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from scipy.spatial.transform import Rotation
from sklearn.cluster import KMeans
from sklearn.covariance import LedoitWolf

from make_motions import ORIGIN
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.geometry.skeleton import MIRROR
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.amc import FPS as AMC_FPS
from posefit.motion.amc import read_clip
from posefit.motion.motion import Motion
from posefit_vsmm import motion as models
from posefit_vsmm.motion import (
    FPS,
    LAMBDA,
    MotionModels,
    leg_of,
    ridge,
    without_heading,
)
from posefit_vsmm.state import BONES, ERROR, HELD, OTHER_ANGLES, STATE, encode, minus

# share of its distance from the mean pose that a joint loses in a frame, if nothing
# else is learned
FADING = 0.07
DRAWN = 400  # frames of a built-in motion
POSES = 24  # typical poses of a model
CAPTURED = 100  # captured poses of a model, in even steps
# legs and radians: smallest standard deviation per frame of a coordinate
LEAST = (0.002, np.radians(0.3))
AHEAD = 10  # frames
# for the body's quaternion and each bone's, the one on the other side
OTHER_SIDE = [0, *(1 + HELD.index(MIRROR[joint]) for joint in HELD)]


class Excerpt(NamedTuple):
    """A clip, or part of it."""

    path: str
    start: int = 0
    stop: int | None = None


class Teaching(NamedTuple):
    """The clips for fitting a model and for testing it.

    The test clip is another person's, or a part that is not used for fitting.
    """

    fitted: tuple[Excerpt, ...]
    kept: Excerpt
    # built-in motions: no clip shows walking with arms held out
    drawn: tuple[str, ...] = ()


TEACHINGS = {
    "stiff-walk": Teaching((Excerpt("17/17_03", 0, 330),), Excerpt("17/17_03", 340)),
    "walk": Teaching(
        (Excerpt("02/02_01"), Excerpt("05/05_01"), Excerpt("16/16_15")),
        Excerpt("16/16_17", 0, 250),
    ),
    "arms-out": Teaching(
        (Excerpt("49/49_18", 0, 820),), Excerpt("49/49_18", 830), ("arms-out-a",)
    ),
    "jacks": Teaching((Excerpt("13/13_29", 0, 456),), Excerpt("14/14_06", 0, 420)),
    "jump": Teaching((Excerpt("16/16_03"), Excerpt("49/49_02")), Excerpt("16/16_01")),
    "squat": Teaching(
        (Excerpt("13/13_29", 3792, 4584),), Excerpt("14/14_06", 1008, 1572)
    ),
}


class Recorded(NamedTuple):
    """States (n, 43) with translations in legs, the angles (n, 66), the frame rate."""

    states: Array
    angles: Array
    fps: float


def recorded(root: Path, clip: Excerpt) -> Recorded:
    folder, name = clip.path.split("/")
    motion = read_clip(root / folder / f"{folder}.asf", root / folder / f"{name}.amc")
    return moving(motion.frames(clip.start, clip.stop or len(motion)))


def moving(motion: Motion) -> Recorded:
    states = encode(motion.poses, motion.translations)
    states[:, :3] /= leg_of(motion.skeleton)
    return Recorded(states, motion.poses, motion.fps)


def mirrored_states(states: Array) -> Array:
    """Return states (n, 43) of the mirror image, left for right."""
    other = states.copy()
    other[:, 0] *= -1.0
    quaternions = states[:, 3:].reshape(len(states), -1, 4)[:, OTHER_SIDE]
    quaternions[:, :, 2:] *= -1.0
    other[:, 3:] = quaternions.reshape(len(states), -1)
    return other


def pairs(clip: Recorded) -> tuple[Array, Array]:
    """Return states (n, 43), and the states a frame later at 30 a second.

    Both are in the first one's heading, with its root at 0.
    """
    # Interpretation V6: all pairs of a recording at this distance
    step = round(clip.fps / FPS)
    before = []
    after = []
    for first, second in zip(clip.states[:-step], clip.states[step:], strict=True):
        heading, here = without_heading(first)
        here *= np.where(here[:, :1] < 0.0, -1.0, 1.0)
        turn = Rotation.from_quat(heading, scalar_first=True).inv()
        there = second[3:].reshape(-1, 4).copy()
        there[0] = (turn * Rotation.from_quat(there[0], scalar_first=True)).as_quat(
            scalar_first=True
        )
        # Interpretation V4
        there *= np.where(np.einsum("ij,ij->i", here, there)[:, None] < 0.0, -1.0, 1.0)
        before.append(np.concatenate([np.zeros(3), here.ravel()]))
        after.append(
            np.concatenate([turn.apply(second[:3] - first[:3]), there.ravel()])
        )
    return np.array(before), np.array(after)


def noise(model: MotionModels, before: Array, after: Array) -> Array:
    """Return the covariance (33, 33) of the model's residuals.

    It is shrunk as proposed by Ledoit and Wolf. Interpretation V7.
    """
    left = minus(after, model.step(before[None])[0])
    least = np.repeat(LEAST, [3, ERROR - 3])
    scale = np.maximum(np.sqrt((left**2).mean(axis=0)), least)
    found = LedoitWolf(assume_centered=True).fit(left / scale).covariance_
    found[np.diag_indices(ERROR)] = np.maximum(np.diag(found), 1.0)
    return np.asarray(found * np.outer(scale, scale))


def typical(before: Array) -> Array:
    """Return the means (24, 40) of similar poses."""
    middles = (
        KMeans(POSES, n_init=4, random_state=0)
        .fit(before[:, 3:])
        .cluster_centers_.reshape(POSES, -1, 4)
    )
    return np.asarray(
        (middles / np.linalg.norm(middles, axis=2, keepdims=True)).reshape(POSES, -1)
    )


def ahead(model: MotionModels, clip: Recorded, frames: int) -> tuple[float, float]:
    """Return a model's mean error in degrees, `frames` ahead, and standing still's."""
    step = round(clip.fps / FPS) * frames
    first = clip.states[:-step]
    second = clip.states[step:]
    states = first[None]
    for _ in range(frames):
        states = model.step(states)
    return _mean_degrees(minus(second, states[0])), _mean_degrees(minus(second, first))


def _mean_degrees(errors: Array) -> float:
    turns = errors[:, 3:].reshape(-1, 3)
    return float(np.degrees(np.linalg.norm(turns, axis=1).mean()))


def dependent(clips: list[Recorded]) -> dict[str, Any]:
    """Return the regression of the other joints' angles on the nine rotations.

    It is a ridge regression over all clips.
    """
    inputs = []
    wanted = []
    for clip in clips:
        for states, angles in (
            (clip.states, clip.angles),
            (
                mirrored_states(clip.states),
                mirrored_poses(built_in.average_skeleton(), clip.angles),
            ),
        ):
            quaternions = states[::4, 7:].reshape(-1, 4)
            inputs.append(
                Rotation.from_quat(quaternions, scalar_first=True)
                .as_rotvec()
                .reshape(-1, 3 * len(BONES))
            )
            wanted.append(angles[::4, OTHER_ANGLES])
    x = np.concatenate(inputs)
    y = np.concatenate(wanted)
    middle = x.mean(axis=0)
    mean = y.mean(axis=0)
    normal = (x - middle).T @ (x - middle) + 0.05 * len(x) * np.eye(x.shape[1])
    matrix = np.linalg.solve(normal, (x - middle).T @ (y - mean)).T
    return {"matrix": rounded(matrix), "offset": rounded(mean - matrix @ middle)}


def rounded(values: Array) -> Any:
    """Return nested lists of numbers with five significant digits."""
    if values.ndim == 1:
        return [float(f"{value:.5g}") for value in values]
    return [rounded(row) for row in values]


def normalised_ridge(
    before: Array, after: Array, target: Array, weight: float
) -> tuple[Array, Array]:
    """Return F minus the identity (43, 40) and the offset (43,), shrunk to `target`.

    Interpretation V5. `target` is (43, 40). The penalty is `weight` per frame, in units
    of the quaternions' mean spread, so that it does not vanish among many frames.
    """
    inputs = before[:, 3:]
    middle = inputs.mean(axis=0)
    unit = np.sqrt(inputs.var(axis=0).sum() / (len(inputs[0]) / 4))
    scaled = (inputs - middle) / unit
    wanted = after - before - inputs @ target.T
    # progress over the ground is not predicted: stepping on the spot is also walking
    wanted[:, [0, 2]] = 0.0
    mean = wanted.mean(axis=0)
    matrix = ridge(scaled, wanted - mean, weight * len(scaled)) / unit
    return matrix + target, mean - matrix @ middle


@click.command(cls=Command)
@click.argument(
    "root", metavar="CMU_DIR", type=click.Path(path_type=Path), envvar="POSEFIT_CMU"
)
def main(root: Path) -> None:
    """Write models.json next to the models. Raises ValueError if a clip is missing."""
    stored: dict[str, Any] = {}
    every: list[Recorded] = []
    identity = np.vstack([np.zeros((3, STATE - 3)), np.eye(STATE - 3)])
    for clip in (
        clip
        for teaching in TEACHINGS.values()
        for clip in (*teaching.fitted, teaching.kept)
    ):
        if not (root / f"{clip.path}.amc").is_file():
            raise InputError(
                f"CMU_DIR must contain {clip.path}.amc, got {root} without it"
            )
    for name, teaching in TEACHINGS.items():
        clips = [recorded(root, clip) for clip in teaching.fitted]
        clips += [
            moving(built_in.motion(one, frames=DRAWN, fps=AMC_FPS))
            for one in teaching.drawn
        ]
        kept = recorded(root, teaching.kept)
        every += clips
        sides = [
            pairs(one._replace(states=s))
            for one in clips
            for s in (one.states, mirrored_states(one.states))
        ]
        before, after = (np.concatenate(part) for part in zip(*sides, strict=True))
        typicals = typical(before)
        found: dict[str, Any] = {}
        report: dict[str, float] = {}
        captured = before[
            np.linspace(0, len(before) - 1, CAPTURED).astype(np.int64), 3:
        ]
        literal = ridge(before[:, 3:], after) - identity, np.zeros(STATE)
        ours = normalised_ridge(before, after, -FADING * identity, LAMBDA)
        for shrink, (matrix, offset) in (("identity", ours), ("zero", literal)):
            model = MotionModels(
                (name,),
                matrix[None],
                offset[None],
                np.eye(ERROR)[None],
                typicals[None],
                captured[None],
            )
            covariance = noise(model, before, after)
            found[shrink] = {
                "matrix": rounded(matrix),
                "offset": rounded(offset),
                "noise": rounded(covariance),
            }
            for frames in (1, AHEAD):
                error, still = ahead(model, kept, frames)
                report |= {
                    f"{shrink}_{frames}": round(error, 2),
                    f"still_{frames}": round(still, 2),
                }
        print(name, len(before), report)
        stored[name] = {
            **found,
            "poses": rounded(typicals),
            "captured": captured.round(3).tolist(),
            "report": report,
        }
    target_file = Path(models.__file__).with_name("models.json")
    text = json.dumps(
        {"origin": ORIGIN, "models": stored, "dependent_joints": dependent(every)},
        separators=(",", ":"),
    )
    target_file.write_text(text + "\n", encoding="utf-8")
    print(f"{target_file.name}: {len(text)} bytes")


if __name__ == "__main__":
    main()
