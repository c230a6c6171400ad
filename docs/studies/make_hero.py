"""Draws the animation of the README.

    python docs/studies/make_hero.py docs/pictures/hero.gif

Two cameras see the silhouettes of a person who is not in the library. Next to them the
tracked body turns.
"""

import sys
from typing import Any

import cv2
import numpy as np
from PIL import Image

import posefit
from posefit.arrays import Array
from posefit.output.drawing import BACKGROUND, LINES, TEXT, draw_body, write

VIEWS = (20.0, 110.0)  # degrees
SILHOUETTE = (232, 232, 232)
GROUND = (16, 14, 13)
# pixels of a silhouette, and of the square picture next to both
WIDE = 288
TALL = 216
STAGE = 432
FRAMES = 60
RATE = 15
COLOURS = 64
DISTANCE = 4.6  # metres from the body to the camera that circles it


def stage(body: posefit.Body, pose: Array, place: Array, azimuth: float) -> Any:
    """Return a picture (STAGE, STAGE, 3) of a body on the ground, with its shadow."""
    image = np.full((STAGE, STAGE, 3), BACKGROUND, np.uint8)
    middle = np.array([place[0], 0.9, place[2]])
    camera = posefit.Camera.around(
        middle, azimuth, DISTANCE, (STAGE, STAGE), np.radians(30.0)
    )
    turns = np.linspace(0.0, 2.0 * np.pi, 65)
    for radius in (0.5, 1.0, 1.5):
        x = place[0] + radius * np.sin(turns)
        z = place[2] + radius * np.cos(turns)
        ring = np.column_stack([x, 0.0 * turns, z])
        cv2.polylines(
            image,
            [np.rint(16 * camera.project(ring)[0]).astype(np.int32)],
            True,
            LINES,
            1,
            cv2.LINE_AA,
            4,
        )
    joints = body.skeleton.joints(pose[None], place[None])[0]
    for joint in joints:
        disc = np.column_stack([np.sin(turns), 0.0 * turns, np.cos(turns)]) * 0.09 + [
            joint[0],
            0.0,
            joint[2],
        ]
        cv2.fillPoly(
            image,
            [np.rint(16 * camera.project(disc)[0]).astype(np.int32)],
            GROUND,
            cv2.LINE_AA,
            4,
        )
    draw_body(image, body, camera, pose, place)
    return image


def main(out: str) -> None:
    """Track a person, and draw the animation."""
    track = posefit.track(
        "16_16", train=["library:-16"], view_degrees=VIEWS, frames=(0, FRAMES)
    )
    print(track)
    pictures = []
    for k, (pose, place) in enumerate(
        zip(track.motion.poses, track.motion.translations, strict=True)
    ):
        masks = list[Any]()
        for view, silhouette in enumerate(track.scene.observations[k].silhouettes):
            seen = np.full((*silhouette.mask.shape, 3), BACKGROUND, np.uint8)
            seen[silhouette.mask] = SILHOUETTE
            masks.append(cv2.resize(seen, (WIDE, TALL), interpolation=cv2.INTER_AREA))
            write(masks[-1], f"camera {view + 1}", (10, 20), TEXT, 0.45)
        body = stage(
            track.scene.body, pose, place, np.radians(20.0 + 240.0 * k / FRAMES)
        )
        write(body, "3D motion, left orange, right blue", (10, 20), TEXT, 0.45)
        whole = np.hstack(
            [np.vstack(masks), np.full((STAGE, 6, 3), LINES, np.uint8), body]
        )
        pictures.append(
            Image.fromarray(whole[..., ::-1]).quantize(
                COLOURS, dither=Image.Dither.NONE
            )
        )
    pictures[0].save(
        out,
        save_all=True,
        append_images=pictures[1:],
        duration=1000 // RATE,
        loop=0,
        optimize=True,
    )


if __name__ == "__main__":
    main(sys.argv[1])
