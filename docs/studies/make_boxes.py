"""Learns the boxes of the suite from the library of recorded motions.

    python docs/studies/make_boxes.py

It writes `posefit/suites/boxes.npz`. A suite's file is never replaced, because its
numbers would change. This program documents how the file was made.
"""

from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in, recorded
from posefit.suites.boxes import (
    CONSTANT,
    HELD_OUT_GROUP,
    SIZES,
    STEP,
    TRAINING_PEOPLE,
    is_upright,
)

# quantiles of the training poses: of each latent, and of the distance from the mean
BOX = 0.99
ELLIPSOID = 0.98
# joint angles: the quantile left out at either end, and the margin added afterwards
RANGE = 0.005
MARGIN = np.radians(5.0)


def learned_from(poses: Array) -> dict[str, NDArray[np.int32]]:
    """Return the statistics of poses (n, 66), as whole multiples of `STEP`."""
    angles = poses[:, 3:]
    mean = np.round(angles.mean(axis=0) / STEP) * STEP
    directions = np.linalg.svd(angles - mean, full_matrices=False)[2][: SIZES[-1]]
    directions *= np.sign(
        directions[np.arange(len(directions)), np.abs(directions).argmax(axis=1)]
    )[:, None]
    components = np.round(directions / STEP) * STEP
    latents = (angles - mean) @ components.T
    spread = latents.std(axis=0)
    low, high = np.quantile(angles, [RANGE, 1.0 - RANGE], axis=0)
    moved = high > low
    values = {
        "mean": mean,
        "components": components,
        "spread": spread,
        "half": np.quantile(np.abs(latents), BOX, axis=0),
        "reach": np.array(
            [
                np.sqrt(
                    np.quantile(
                        ((latents[:, :m] / spread[:m]) ** 2).sum(axis=1), ELLIPSOID
                    )
                )
                for m in SIZES
            ]
        ),
        "low": np.where(moved, low - MARGIN, mean - CONSTANT),
        "high": np.where(moved, high + MARGIN, mean + CONSTANT),
    }
    learned = {
        name: np.round(value / STEP).astype(np.int32) for name, value in values.items()
    }
    learned["order"] = np.argsort(-angles.std(axis=0), kind="stable").astype(np.int32)
    return learned


def upright_poses(subjects: tuple[str, ...]) -> Array:
    """Return the upright poses (n, 66) of people, and their mirror images."""
    poses = wrapped(np.concatenate([clip.poses for clip in recorded.clips(subjects)]))
    poses = poses[[is_upright(pose) for pose in poses]]
    return wrapped(
        np.concatenate([poses, mirrored_poses(built_in.average_skeleton(), poses)])
    )


@click.command()
def main() -> None:
    """Write the file."""
    groups = {
        name: tuple(person for person in TRAINING_PEOPLE if person != name)
        for name in (*TRAINING_PEOPLE, HELD_OUT_GROUP)
    }
    learned = [learned_from(upright_poses(people)) for people in groups.values()]
    arrays: dict[str, Any] = {
        name: np.stack([group[name] for group in learned]) for name in learned[0]
    }
    path = Path(__file__).parents[2] / "posefit" / "suites" / "boxes.npz"
    np.savez_compressed(path, names=np.array(list(groups)), **arrays)


if __name__ == "__main__":
    main()
