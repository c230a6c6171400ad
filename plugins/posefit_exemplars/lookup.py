"""The start `lookup`: poses of clips whose silhouettes resemble the observed ones.

A table contains the silhouettes of some poses of clips, each turned to 24 yaws, as seen
by a camera that looks straight at the person. A silhouette is scaled to 16 x 16 pixels,
and its code is the principal components of this picture. So one product of a matrix and
a vector compares an observation with the whole table. The costs of the nearest poses
then give their weights.

After Brand, Shadow puppetry, 1999, and Li, Sun, Chen and Li's references 2 and 3: a
silhouette suggests a pose, and a search then makes it fit.
"""

import math
from functools import lru_cache
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.arrays.compiling import state_of
from posefit.arrays.stored import Arrays, stored
from posefit.fitting.start import TEMPERATURE
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.calibration import pinhole_matrix
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.silhouette.cost import masks_of
from posefit.silhouette.drawn import uncounted
from posefit.silhouette.mask import Mask, Silhouette, box_of, without_small_pieces
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.exemplars import SAME_TURN, YAWS, Exemplars, exemplars_for
from posefit_exemplars.frame_costs import SIDE, FrameCosts
from posefit_exemplars.kernels import Rows

POSES = 2000  # poses in a table, drawn by `Exemplars.draw`
DISTANCE = 4.3  # metres from the camera of a table to the person
PICTURE = 64  # side of the camera's picture, pixels
DIMENSIONS = 64  # dimensions of a code
# Nothing is suggested if the squared distance to the nearest code is larger. 99 % of
# damaged silhouettes of unknown people are nearer.
MAX_DISTANCE = 16.0
YAW_TOLERANCE = np.radians(45.0)  # of a known yaw, to either side
Codes = NDArray[np.float32]  # (n, DIMENSIONS)


class Table(NamedTuple):
    """The codes of the silhouettes of states, each turned to `YAWS` yaws.

    The camera sees a person of yaw 0 from the front.
    """

    states: Rows  # (n,)
    mean: Codes  # (SIDE^2,)
    axes: Codes  # (SIDE^2, DIMENSIONS)
    codes: Codes  # (n YAWS, DIMENSIONS)
    squares: Codes  # (n YAWS,) the squared lengths of the codes

    @classmethod
    def of(cls, exemplars: Exemplars, elevation: float) -> Self:
        """Return the table for an average body seen from an elevation, in radians.

        It is cached on disk if the exemplars are.
        """
        if not exemplars.digest:
            return cls(**_learned(exemplars, elevation))
        state = repr((state_of(__name__), elevation)).encode()
        digest = exemplars.digest + state
        return cls(**stored("lookup", digest, lambda: _learned(exemplars, elevation)))

    def distances(self, picture: Mask) -> Codes:
        """Return the squared distances (n, YAWS) of all states from a picture."""
        code = (small_pictures(picture[None])[0] - self.mean) @ self.axes
        squares = self.squares - 2.0 * (self.codes @ code) + code @ code
        return np.asarray(squares.reshape(-1, YAWS))


def _learned(exemplars: Exemplars, elevation: float) -> Arrays:
    """Return the arrays of a table: codes of the silhouettes of some states, by yaw."""
    body = Body.of(exemplars.coding.skeleton)
    states = np.arange(len(exemplars))
    if len(states) > POSES:
        states = np.unique(exemplars.draw(POSES, np.random.default_rng(0)))
    yaws = np.tile(SAME_TURN * np.arange(YAWS), len(states))
    poses = exemplars.with_yaws(np.repeat(states, YAWS), yaws)
    camera = looking_at(0.0, elevation)
    pixels = np.empty((len(poses), SIDE**2), np.float32)
    filled = 0
    # in parts, because pictures take memory
    for part in np.array_split(poses, YAWS):
        masks = masks_of(body, camera, part, -body.skeleton.joints(part).mean(axis=1))
        pixels[filled : filled + len(part)] = small_pictures(masks)
        filled += len(part)
    mean = pixels.mean(axis=0)
    _, directions = np.linalg.eigh(np.cov(pixels[:: YAWS // 4], rowvar=False))
    axes = directions[:, : -DIMENSIONS - 1 : -1].astype(np.float32)
    # in place: a copy would be as large as all else
    pixels -= mean
    codes = pixels @ axes
    return {
        "states": states,
        "mean": mean,
        "axes": axes,
        "codes": codes,
        "squares": (codes**2).sum(axis=1),
    }


_table = lru_cache(maxsize=4)(Table.of)


def looking_at(azimuth: float, elevation: float) -> Camera:
    """Return a table's camera, which looks at the origin from these angles, radians."""
    level = Camera.around(np.zeros(3), azimuth, DISTANCE, (PICTURE, PICTURE))
    sine = np.sin(elevation)
    cosine = np.cos(elevation)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    return Camera(
        PICTURE,
        PICTURE,
        level.focal,
        level.centre,
        tilt @ level.rotation,
        level.translation,
    )


def small_pictures(masks: Mask) -> Codes:
    """Return the square around each person, scaled to SIDE x SIDE pixels (n, SIDE^2).

    A pixel is the share, 0 to 1, that the person covers.
    """
    small = np.empty((len(masks), SIDE, SIDE), np.uint8)
    for mask, pixels in zip(masks.view(np.uint8), small, strict=True):
        left, top, width, height = cv2.boundingRect(mask)
        side = max(width, height, 1)
        square = np.zeros((side, side), np.uint8)
        row = (side - height) // 2
        column = (side - width) // 2
        square[row : row + height, column : column + width] = (
            255 * mask[top : top + height, left : left + width]
        )
        cv2.resize(square, (SIDE, SIDE), dst=pixels, interpolation=cv2.INTER_AREA)
    return (small.reshape(len(masks), -1) / np.float32(255.0)).astype(np.float32)


def straightened(camera: Camera, silhouette: Silhouette) -> tuple[Mask, float, float]:
    """Return what an upright camera sees that looks straight at the person.

    It has the position of the silhouette's camera, and the person fills most of its
    picture.

    Returns:
        The mask (PICTURE, PICTURE), and the azimuth and elevation of the new camera in
        radians.
    """
    mask = without_small_pieces(silhouette.mask)
    left, top, right, bottom = box_of(mask)
    corners = np.array(
        [[left, top], [right, top], [left, bottom], [right, bottom]], dtype=np.float64
    )
    directions = np.column_stack([(corners - camera.centre) / camera.focal, np.ones(4)])
    rays = directions @ camera.rotation  # (4, 3)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    x, y, z = ray = rays.sum(axis=0) / np.linalg.norm(rays.sum(axis=0))
    azimuth = float(np.arctan2(-x, -z))
    elevation = float(np.arcsin(-y))
    straight = looking_at(azimuth, elevation)
    half = float(np.arccos(np.clip(rays @ ray, -1.0, 1.0)).max())
    # 5 % of margin; the limit keeps the tangent finite if the person is so close that
    # they fill half of the camera's surroundings
    focal = 0.5 * PICTURE / np.tan(min(1.05 * half, 1.2))
    to_picture = pinhole_matrix([focal, focal], [PICTURE / 2.0, PICTURE / 2.0])
    from_image = np.linalg.inv(pinhole_matrix(camera.focal, camera.centre))
    homography = to_picture @ straight.rotation @ camera.rotation.T @ from_image
    # pixel centres are whole numbers in OpenCV, but halves here
    shift = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    homography = np.linalg.inv(shift) @ homography @ shift
    picture = cv2.warpPerspective(
        255 * mask.astype(np.uint8),
        homography,
        (PICTURE, PICTURE),
        flags=cv2.INTER_AREA,
    )
    return picture > 127, azimuth, elevation


class Lookup:
    """Suggests poses of clips, and their mirror images, by their silhouettes."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.exemplars = exemplars_for(task)

    def nearest(
        self, observation: Observation, count: int, yaw: float | None = None
    ) -> tuple[Rows, Array, float] | None:
        """Return the states whose silhouettes are most similar to a frame's.

        Args:
            observation: The silhouettes of the frame.
            count: How many states, at most.
            yaw: The person's yaw in radians, or None if it is unknown. Yaws of states
                are near it.

        Returns:
            The states (n,), their yaws (n,), and the least squared distance, a mean
            over the cameras that show the whole person. None if no camera does.
        """
        total = np.zeros(1)
        views = list[tuple[Table, float]]()
        pairs = zip(self.task.cameras, observation.silhouettes, strict=True)
        for camera, silhouette in pairs:
            if np.isfinite(silhouette.extent).all():
                picture, azimuth, elevation = straightened(camera, silhouette)
                # a table for each multiple of it
                rounded = float(np.round(elevation / SAME_TURN) * SAME_TURN)
                # a table is made once per process, so its poses do not count here
                with uncounted():
                    table = _table(self.exemplars, rounded)
                views.append((table, azimuth))
                # yaws in a table are relative to its camera, here to the first camera
                turn = round((azimuth - views[0][1]) / SAME_TURN)
                total = total + np.roll(table.distances(picture), turn, axis=1)
        if not views:
            return None
        yaws = wrapped(np.asarray(views[0][1] + SAME_TURN * np.arange(YAWS)))
        distances = total / len(views)
        if yaw is not None:
            distances[:, np.abs(wrapped(yaws - yaw)) > YAW_TOLERANCE] = np.inf
        # of two neighbouring yaws only the better one is returned
        first = distances[:, ::2]
        second = distances[:, 1::2]
        better = second < first
        flat = np.where(better, second, first).ravel()
        count = min(count, len(flat))
        rows = np.argpartition(flat, count - 1)[:count]
        rows = rows[np.argsort(flat[rows], kind="stable")]
        rows = rows[np.isfinite(flat[rows])]
        states, turns = np.divmod(rows, YAWS // 2)
        chosen = yaws[2 * turns + better[states, turns]]
        return views[0][0].states[states], chosen, float(flat[rows[0]])

    def posterior(self, observation: Observation) -> Posterior | None:
        """Return the poses that a frame may show, with weights.

        It is None if no pose has similar silhouettes.
        """
        if not observation.usable:
            return None
        known = self.task.yaw if observation.yaw is None else observation.yaw
        frame_costs = FrameCosts(self.task, observation)
        # the square root leaves nearly all evaluations for the search
        count = math.isqrt(int(self.task.evaluations / frame_costs.small_share))
        nearest = self.nearest(observation, count, known)
        if nearest is None or nearest[2] > MAX_DISTANCE:
            return None
        poses = self.exemplars.with_yaws(*nearest[:2])
        places = frame_costs.aligned(
            poses, np.repeat(self.task.anchor[None], len(poses), axis=0)
        )
        costs = frame_costs.small(poses, places)
        return Posterior(poses, places, np.exp((costs.min() - costs) / TEMPERATURE))
