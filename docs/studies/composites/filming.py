"""A situation is filmed: a video a camera, their calibration, and what is truly seen of whom."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from composites.clothes import outfit
from composites.plates import Plate, sensed
from composites.rendering import Posed, composited, true_masks
from composites.situations import Situation
from posefit.footage.video import VideoWriter
from posefit.geometry.calibration import HALF
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Mask

BEFORE = 20  # frames of the empty place that a background is learned from, where one is given


@dataclass(frozen=True, eq=False)
class Filmed:
    """What was written of a situation, and the truth of it."""

    videos: list[Path]
    calibration: Path
    first: int  # the frame of the videos that is the situation's first
    masks: NDArray[np.bool_] = field(repr=False)  # (views, T, height, width): what is seen of the first actor


def film(situation: Situation, plates: Sequence[Plate], seed: int, empty_first: bool, folder: Path) -> Filmed:
    """Return what is written to a folder: a video a camera, with the empty place first if asked for, and the truth.

    `plates` are the empty pictures of each camera.
    """
    rng = np.random.default_rng([seed, 4])
    first = BEFORE if empty_first else 0
    videos, masks = [], []
    fps = situation.actors[0].motion.fps
    for number, (camera, behind) in enumerate(zip(situation.cameras, plates, strict=True)):
        path = folder / f"camera-{number + 1}.mp4"
        seen: list[Mask] = []
        with VideoWriter(path, fps, (camera.width, camera.height)) as writer:
            for k in range(first):
                writer.write(sensed(behind.frame(k), k, rng))
            for k, (people, mask) in enumerate(_frames(situation, camera, behind)):
                writer.write(sensed(composited(behind.frame(first + k), camera, people), first + k, rng))
                seen.append(mask)
        videos.append(path)
        masks.append(np.stack(seen))
    calibration = folder / "cameras.toml"
    calibration.write_text(calibration_text(situation.cameras), encoding="utf-8")
    return Filmed(videos, calibration, first, np.stack(masks))


def _frames(situation: Situation, camera: Camera, behind: Plate) -> Iterator[tuple[list[Posed], Mask]]:
    """Yield who is there in each frame, and what is seen of the first actor."""
    clothes = [outfit(actor.outfit, behind.still.astype(np.uint8)) for actor in situation.actors]
    for k in range(len(situation)):
        people = [
            Posed(actor.body, actor.motion.poses[k], actor.motion.translations[k], worn)
            for actor, worn in zip(situation.actors, clothes, strict=True)
            if actor.present[k]
        ]
        masks = true_masks(camera, people)
        there = bool(situation.actors[0].present[k])
        yield people, masks[0] if there else np.zeros((camera.height, camera.width), dtype=bool)


def calibration_text(cameras: Sequence[Camera]) -> str:
    """Return the text of a calibration file, as Pose2Sim and Sports2D write it."""
    told = []
    for number, camera in enumerate(cameras, 1):
        (fx, fy), (cx, cy) = camera.focal, camera.centre - HALF
        vector = cv2.Rodrigues(camera.rotation)[0].reshape(3)
        told.append(
            f'[camera{number}]\nname = "camera{number}"\nsize = [{camera.width}.0, {camera.height}.0]\n'
            f"matrix = [[{fx}, 0.0, {cx}], [0.0, {fy}, {cy}], [0.0, 0.0, 1.0]]\n"
            f"distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = {vector.tolist()}\n"
            f"translation = {camera.translation.tolist()}\nfisheye = false\n"
        )
    return "\n".join(told)
