"""A picture of a row: frames of its first two cameras, with the mask that was taken out and the fitted body."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from composites.figures import uncut
from composites.filming import Filmed
from composites.situations import Situation
from posefit.arrays import Array
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.tracking.drawing.body import draw_stick, side_camera
from posefit.tracking.run import Track

SHARES = (0.15, 0.38, 0.62, 0.85)  # of the frames in which the person is whole: those that are shown
CAMERAS = 2  # that are shown at most
TAKEN, FITTED, TRUE = (60, 220, 60), (40, 140, 255), (255, 255, 255)  # outlines: mask, fitted body, true mask
WIDE = 300  # pixels of a frame that are shown, about the person
SIDE = 100  # pixels of the view from the camera's right


def stills(path: Path, made: Filmed, scene: Situation, masks: NDArray[np.bool_], result: Track, radii: Array) -> None:
    """Write a picture: green is the mask that was taken out, orange the fitted body, white the true mask.

    In the corner are the true bones, white, and the fitted ones, seen from the first camera's right.
    """
    seen = np.flatnonzero(uncut(made.masks)[0])
    frames = [int(seen[int(share * len(seen))]) for share in SHARES]
    body = Body(result.motion.skeleton, radii)
    rows = []
    for number, camera in enumerate(scene.cameras[:CAMERAS]):
        images = []
        for k in frames:
            image = _frame(made, number, k)
            fitted = project(body, camera, result.motion.poses[k], result.motion.translations[k])
            for mask, colour in ((made.masks[number, k], TRUE), (masks[number, k], TAKEN), (fitted, FITTED)):
                _outline(image, mask, colour)
            image = _about(image, made.masks[number, k])
            if number == 0:
                image[:SIDE, :SIDE] = _aside(scene, camera, body, result.motion, k)
            images.append(image)
        rows.append(np.hstack(images))
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 88])


def _frame(made: Filmed, camera: int, k: int) -> Image:
    video = Video.of(made.videos[camera])
    return next(iter(video.frames(made.first + k, made.first + k + 1, video.size)))


def _outline(image: Image, mask: Mask, colour: tuple[int, int, int]) -> None:
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, outlines, -1, colour, 1, cv2.LINE_AA)


def _about(image: Image, mask: Mask) -> Image:
    """Return the part of an image, as high as it is, that has a mask in its middle."""
    columns = np.flatnonzero(mask.any(axis=0))
    middle = int(columns.mean()) if len(columns) else image.shape[1] // 2
    left = int(np.clip(middle - WIDE // 2, 0, image.shape[1] - WIDE))
    return image[:, left : left + WIDE].copy()


def _aside(scene: Situation, camera: Camera, body: Body, motion: Motion, k: int) -> Image:
    """Return bones from the camera's right: the true ones white; both roots at one point."""
    image = np.zeros((SIDE, SIDE, 3), dtype=np.uint8)
    actor = scene.actors[0]
    true_pose, place = actor.motion.poses[k], actor.motion.translations[k]
    aside = side_camera(actor.body, camera, true_pose, place, SIDE)
    draw_stick(image, actor.body, aside, true_pose, place)
    fitted = np.zeros_like(image)
    draw_stick(fitted, body, aside, motion.poses[k], place)
    image[fitted.any(axis=2)] = FITTED
    return image
