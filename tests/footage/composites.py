"""Videos of a person in patterned clothes, rendered in front of a still background: passing by, or always there."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

import posefit
from posefit.motion import built_in
from posefit.silhouette.cost import project

SIZE = (320, 240)
FRAMES = 60
DEMO = (
    Path(__file__).parents[3]
    / "shared"
    / "data"
    / "video"
    / "sports2d_walk"
    / "demo.mp4"
)
Kind = Literal["passing", "jumping", "waving", "standing", "leaving"]


def backgrounds() -> list[Any]:
    """Return pictures of an empty place, each with its own noise."""
    rng = np.random.default_rng(1)
    place = cv2.GaussianBlur(
        rng.uniform(0.0, 255.0, (SIZE[1], SIZE[0], 3)), (0, 0), 6.0
    )
    place = 120.0 + 40.0 * (place - place.mean()) / place.std()
    return [
        np.clip(place + rng.normal(0.0, 3.0, place.shape), 0, 255).astype(np.uint8)
        for _ in range(FRAMES)
    ]


def moving(kind: Kind) -> posefit.Motion:
    """Return how the person moves."""
    name = {"jumping": "jacks", "waving": "wave", "standing": "wave"}.get(kind, "walk")
    motion = built_in.motion(name, frames=FRAMES)
    places = motion.translations.copy()
    places[:, [0, 2]] = 0.0
    sway = np.sin(np.arange(FRAMES) / 9.0)
    if kind == "passing":
        places[:, 2] = np.linspace(-1.4, 1.4, FRAMES)
    elif kind == "leaving":
        places[36:, 2] = np.linspace(0.0, 3.0, FRAMES - 36)
    else:
        places[:, 2] = 0.01 * sway
    poses = (
        motion.poses
        if kind != "standing"
        else np.repeat(motion.poses[:1], FRAMES, axis=0) + 0.02 * sway[:, None]
    )
    return replace(motion, poses=poses, translations=places)


def composed(path: Path, kind: Kind, places: list[Any]) -> tuple[Path, list[Any]]:
    """Write a video and return it with the true mask of each frame."""
    rng = np.random.default_rng(0)
    tall, wide = places[0].shape[:2]
    motion = moving(kind)
    body = posefit.Body.of(motion.skeleton)
    azimuth = np.pi / 2 if kind in ("passing", "leaving") else 0.6
    camera = posefit.Camera.around(
        np.array([0.0, 1.1, 0.0]), azimuth, 5.5, (wide, tall)
    )
    cloth = cv2.GaussianBlur(rng.normal(0.0, 1.0, (tall, wide)), (0, 0), 2.0)
    cloth *= 14.0 / cloth.std()
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (wide, tall)
    )
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 95)
    masks = []
    for place, pose, where in zip(
        places, motion.poses, motion.translations, strict=True
    ):
        mask = project(body, camera, pose, where)
        rows = np.flatnonzero(mask.any(axis=1))
        down = ((np.arange(tall) - rows.min(initial=tall)) / max(1, len(rows)))[
            :, None, None
        ]
        colour = np.where(
            down < 0.14,
            (120.0, 150.0, 200.0),
            np.where(down < 0.5, (60.0, 50.0, 140.0), (90.0, 60.0, 40.0)),
        )
        moved = (
            np.roll(
                cloth,
                tuple(int(v) for v in np.argwhere(mask).mean(axis=0)),
                axis=(0, 1),
            )
            if len(rows)
            else cloth
        )
        person = colour + moved[..., None] + rng.normal(0.0, 3.0, place.shape)
        soft = cv2.GaussianBlur(mask.astype(np.float64), (0, 0), 0.8)[..., None]
        writer.write(
            np.clip(soft * person + (1.0 - soft) * place, 0.0, 255.0).astype(np.uint8)
        )
        masks.append(mask)
    writer.release()
    return path, masks
