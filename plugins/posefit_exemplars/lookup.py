"""Where a search may begin: poses of clips whose silhouettes are like the observed ones, found in a table of codes.

The table has the silhouettes of some poses of clips, each turned to 24 yaws, as a camera sees them that looks straight
at the person. The code of a silhouette is what a picture of 16 x 16 pixels shows of it, in principal components. One
product of a matrix and a vector compares an observation with all of them; the costs of the nearest weigh these.

After Brand, Shadow puppetry, 1999, and Li, Sun, Chen and Li's references 2 and 3: a silhouette suggests a pose, and a
search then makes it fit.
"""

from functools import lru_cache
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.arrays.compiling import state_of
from posefit.arrays.stored import Arrays, stored
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.calibration import pinhole_matrix
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.silhouette.cost import masks_of
from posefit.silhouette.drawn import uncounted
from posefit.silhouette.mask import Mask, Silhouette, box_of, without_small_pieces
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.exemplars import Exemplars, Rows, exemplars_for
from posefit_exemplars.frame_costs import FrameCosts

POSES = 2000  # drawn of the clips as `Exemplars.draw` does
YAWS = 24  # that each is turned to
YAW_STEP = 2.0 * np.pi / YAWS
ELEVATION = np.radians(10.0)  # between the tables of cameras that look down, or up
DISTANCE = 4.3  # metres from which a camera of the table sees the person
FIELD_OF_VIEW = 0.85  # radians, of that camera
# pixels of its pictures, and of the small ones that codes are made of
PICTURE = 64
SIDE = 16
DIMENSIONS = 64  # of a code
CANDIDATES = 512  # that are nearest in the table, whose costs are counted
COSTS_SHARE = 0.08  # of a frame's evaluations: for these costs, at most
TEMPERATURE = 4.0  # divides their costs
# squared, of codes, to the nearest: 99 % of damaged silhouettes of unknown people are
# nearer
MAX_DISTANCE = 16.0
YAW_TOLERANCE = np.radians(50.0)  # of a known yaw, to either side
RNG_STREAM_TABLE = 61
Codes = NDArray[np.float32]  # (n, DIMENSIONS)


class Table(NamedTuple):
    """The codes of the silhouettes of states, turned to `YAWS` yaws, seen from the front of yaw 0."""

    states: Rows  # (n,)
    mean: Codes  # (SIDE^2,)
    axes: Codes  # (SIDE^2, DIMENSIONS)
    codes: Codes  # (n YAWS, DIMENSIONS)
    squares: Codes  # (n YAWS,) of their lengths

    @classmethod
    def of(cls, exemplars: Exemplars, elevation: float) -> Self:
        """Return the table of the average body that a camera sees from an elevation, radians.

        It is made once on a machine for what the exemplars were learned from.
        """
        if not exemplars.digest:
            return cls(**_learned(exemplars, elevation))
        state = repr((state_of(__name__), elevation)).encode()
        return cls(
            **stored(
                "lookup",
                exemplars.digest + state,
                lambda: _learned(exemplars, elevation),
            )
        )

    def distances(self, picture: Mask) -> Codes:
        """Return the squared distances (n, YAWS) of all silhouettes from that of a picture (height, width)."""
        code = (small_pictures(picture[None])[0] - self.mean) @ self.axes
        squares = self.squares - 2.0 * (self.codes @ code) + code @ code
        return np.asarray(squares.reshape(-1, YAWS))


def _learned(exemplars: Exemplars, elevation: float) -> Arrays:
    """Return the arrays of the table of an elevation: the silhouettes of some states at each yaw."""
    body = Body.of(exemplars.coding.skeleton)
    states = np.arange(len(exemplars))
    if len(states) > POSES:
        states = np.unique(
            exemplars.draw(POSES, np.random.default_rng(RNG_STREAM_TABLE))
        )
    yaws = np.tile(YAW_STEP * np.arange(YAWS), len(states))
    poses = exemplars.with_yaws(np.repeat(states, YAWS), yaws)
    camera = looking_at(0.0, elevation)
    small = list[Codes]()
    for part in np.array_split(poses, YAWS):  # pictures take memory
        masks = masks_of(body, camera, part, -body.skeleton.joints(part).mean(axis=1))
        small.append(small_pictures(masks))
    pixels = np.concatenate(small)
    mean = pixels.mean(axis=0)
    _, directions = np.linalg.eigh(np.cov(pixels[:: YAWS // 4], rowvar=False))
    axes = directions[:, : -DIMENSIONS - 1 : -1].astype(np.float32)
    codes = (pixels - mean) @ axes
    return {
        "states": states,
        "mean": mean,
        "axes": axes,
        "codes": codes,
        "squares": (codes**2).sum(axis=1),
    }


_table = lru_cache(maxsize=4)(Table.of)


def looking_at(azimuth: float, elevation: float) -> Camera:
    """Return the camera of the table: it looks at the origin from an azimuth and an elevation, radians."""
    level = Camera.around(
        np.zeros(3), azimuth, DISTANCE, (PICTURE, PICTURE), FIELD_OF_VIEW
    )
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
    """Return the square about each person's borders as SIDE x SIDE pixels (n, SIDE^2), shares of 0 to 1."""
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
    """Return what an upright camera sees that looks straight at the person, and its azimuth and elevation, radians.

    It stands where the camera of the silhouette does, and the person fills most of its picture.
    """
    mask = without_small_pieces(silhouette.mask)
    left, top, right, bottom = box_of(mask)
    corners = np.array(
        [[left, top], [right, top], [left, bottom], [right, bottom]], dtype=np.float64
    )
    rays = (
        np.column_stack([(corners - camera.centre) / camera.focal, np.ones(4)])
        @ camera.rotation
    )
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    x, y, z = ray = rays.sum(axis=0) / np.linalg.norm(rays.sum(axis=0))
    azimuth = float(np.arctan2(-x, -z))
    elevation = float(np.arcsin(-y))
    straight = looking_at(azimuth, elevation)
    half = float(np.arccos(np.clip(rays @ ray, -1.0, 1.0)).max())
    focal = 0.5 * PICTURE / np.tan(min(1.05 * half, 1.2))
    to_picture = pinhole_matrix([focal, focal], [PICTURE / 2.0, PICTURE / 2.0])
    from_image = np.linalg.inv(pinhole_matrix(camera.focal, camera.centre))
    homography = to_picture @ straight.rotation @ camera.rotation.T @ from_image
    # OpenCV's pixel centres are whole numbers
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
    """Poses of the motions learned from, and their mirror images, whose silhouettes are like the observed ones."""

    def __init__(self, task: Task) -> None:
        self.task, self.exemplars = task, exemplars_for(task)

    def nearest(
        self, observation: Observation, count: int, yaw: float | None = None
    ) -> tuple[Rows, Array, float] | None:
        """Return the states and yaws (n,) whose silhouettes are most like those of a frame, and the least distance.

        The distance is squared, and the mean over the cameras that show the whole person; None where none does. Yaws
        are near a known one.
        """
        total = np.zeros(1)
        views = list[tuple[Table, float]]()
        for camera, silhouette in zip(
            self.task.cameras, observation.silhouettes, strict=True
        ):
            if np.isfinite(silhouette.extent).all():
                picture, azimuth, elevation = straightened(camera, silhouette)
                with uncounted():  # a table is learned, once a process
                    table = _table(
                        self.exemplars,
                        float(np.round(elevation / ELEVATION) * ELEVATION),
                    )
                views.append((table, azimuth))  # whose yaws count from the camera
                turn = round((azimuth - views[0][1]) / YAW_STEP)
                total = total + np.roll(table.distances(picture), turn, axis=1)
        if not views:
            return None
        yaws = wrapped(np.asarray(views[0][1] + YAW_STEP * np.arange(YAWS)))
        distances = total / len(views)
        if yaw is not None:
            distances[:, np.abs(wrapped(yaws - yaw)) > YAW_TOLERANCE] = np.inf
        # of two yaws side by side the better one is an alternative
        pairs = distances.reshape(len(distances), -1, 2)
        better = pairs.argmin(axis=2)
        flat = pairs.min(axis=2).ravel()
        count = min(count, len(flat))
        rows = np.argpartition(flat, count - 1)[:count]
        rows = rows[np.argsort(flat[rows], kind="stable")]
        rows = rows[np.isfinite(flat[rows])]
        states, turns = np.divmod(rows, YAWS // 2)
        chosen = yaws[2 * turns + better[states, turns]]
        return views[0][0].states[states], chosen, float(flat[rows[0]])

    def posterior(self, observation: Observation) -> Posterior | None:
        """Return the poses that a frame may show, with weights; None where its silhouettes are like none of them."""
        if not observation.usable:
            return None
        known = self.task.yaw if observation.yaw is None else observation.yaw
        frame_costs = FrameCosts(self.task, observation)
        affordable = int(COSTS_SHARE * self.task.evaluations / frame_costs.small_share)
        nearest = self.nearest(observation, min(CANDIDATES, affordable), known)
        if nearest is None or nearest[2] > MAX_DISTANCE:
            return None
        poses = self.exemplars.with_yaws(*nearest[:2])
        places = frame_costs.aligned(
            poses, np.repeat(self.task.anchor[None], len(poses), axis=0)
        )
        costs = frame_costs.small(poses, places)
        return Posterior(poses, places, np.exp((costs.min() - costs) / TEMPERATURE))
