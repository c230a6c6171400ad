"""Poses from silhouettes by regression. No body is drawn to fit a frame.

A. Agarwal, B. Triggs, Recovering 3D human pose from monocular images, IEEE Trans.
Pattern Analysis and Machine Intelligence 28(1), 2006. A silhouette becomes a histogram:
the shape contexts of its border points vote for the words of a codebook. Kernel
regression on rendered training poses gives the pose. In a sequence the predicted pose
is a second input, since several poses may have the same silhouette.

Interpretations: damped least squares with a kernel at every training pose, instead of
the sparse relevance vector machine that the publication prefers; a product of kernels
of silhouette and predicted pose; the histograms of several views side by side. The
budget of a frame does not include rendering the training poses.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, Frame, Observation, Task, at_least, positive, project
from posefit_related.frames import frame_of, place_of, squared_distances
from posefit_related.training import training_poses

POINTS = 80  # ours: largest number of border points
# ours: the bins of a shape context
SECTORS = 12
RINGS = 5
# ours: range of training poses to either side of a known first yaw
YAW_REACH = np.radians(90.0)
# ours: width of a vote, as a share of the root mean square distance from the words
VOTE_WIDTH = 0.25
# ours: noise of the predicted poses in training, in standard deviations of each number
PREDICTION_NOISE = 0.5
DAMPING = 0.5  # ours: share of the velocity that the prediction retains
# ours: sharpnesses of the factors of the kernel
SILHOUETTE_SHARPNESS = 3.0
YAW_SHARPNESS = 0.3
ANGLES_SHARPNESS = 0.5


def contexts(mask: NDArray[np.bool_]) -> Array:
    """Return the shape contexts (n, 60) of points on a mask's border.

    A shape context is the share of the other points in each bin around a point. There
    are `SECTORS` bins in each of `RINGS` rings, whose radii double.
    """
    padded = np.pad(np.asarray(mask, dtype=bool), 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    points = np.argwhere(padded[1:-1, 1:-1] & ~inner).astype(np.float64)
    if len(points) < 3:
        return np.zeros((1, SECTORS * RINGS))
    points = points[
        np.linspace(0, len(points) - 1, min(POINTS, len(points))).astype(int)
    ]
    away = points[None] - points[:, None]
    far = np.hypot(*np.moveaxis(away, 2, 0))
    ring = np.clip(
        np.log2(far / far.mean() + 1e-9) + RINGS - 1.5, 0.0, RINGS - 1.0
    ).astype(int)
    sector = (
        (np.arctan2(away[..., 0], away[..., 1]) + np.pi) * SECTORS / (2.0 * np.pi)
    ).astype(int) % SECTORS
    bins = ring * SECTORS + sector + SECTORS * RINGS * np.arange(len(points))[:, None]
    others = bins[~np.eye(len(points), dtype=bool)]
    counts = np.bincount(others, minlength=SECTORS * RINGS * len(points)).reshape(
        len(points), -1
    )
    return np.asarray(counts / (len(points) - 1.0))  # AGARWAL2006 (shape context)


def histogram(shapes: Array, words: Array) -> Array:
    """Return the votes (k,) of contexts (n, 60) for a codebook's words (k, 60).

    They sum to 1.
    """
    squares = squared_distances(shapes, words)
    squares -= squares.min(axis=1, keepdims=True)
    width = VOTE_WIDTH * np.sqrt(squares.mean()) + 1e-9
    votes = np.exp(-squares / (2.0 * width**2))
    # AGARWAL2006 (histogram)
    return np.asarray((votes / votes.sum(axis=1, keepdims=True)).mean(axis=0))


class Regression:
    """Kernel regression from silhouettes, and in a sequence from predicted poses too.

    Settings:
        samples: Number of training poses, each at a random yaw, 10 or more.
        words: Size of the codebook, 2 or more.
        ridge: Damping of the regression, above 0.
    """

    def __init__(
        self, task: Task, *, samples: int = 1200, words: int = 100, ridge: float = 0.02
    ) -> None:
        from sklearn.cluster import MiniBatchKMeans

        at_least("samples", samples, 10)
        at_least("words", words, 2)
        positive("ridge", ridge)
        self.task = task
        rng = np.random.default_rng(0)
        poses = training_poses(task)
        poses = poses[rng.integers(len(poses), size=samples)]
        reach = np.pi if task.yaw is None else YAW_REACH
        poses[:, 0] = rng.uniform(-1.0, 1.0, samples) * reach + (task.yaw or 0.0)
        shapes = []  # for each view the points of each pose's outline
        sample = []  # some of the outlines, from which the words are learned
        for view in task.cameras:
            shapes_of_view = []
            for pose in poses:
                mask = project(task.body, view, pose, task.anchor)
                shapes_of_view.append(contexts(mask))
            shapes.append(shapes_of_view)
            sample += shapes_of_view[:: max(samples // 200, 1)]
        some = np.concatenate(sample)
        self.words = (
            MiniBatchKMeans(min(words, len(some)), n_init=1, random_state=0)
            .fit(some)
            .cluster_centers_
        )
        histograms = []
        for shapes_of_view in shapes:
            histograms.append(
                [histogram(shape, self.words) for shape in shapes_of_view]
            )
        self.histograms = np.concatenate(histograms, axis=1)
        self.spread = float(
            ((self.histograms - self.histograms.mean(axis=0)) ** 2).sum(axis=1).mean()
        )
        values = regressed(poses)
        self.mean = values.mean(axis=0)
        self.scale = np.maximum(values.std(axis=0), 1e-3)
        self.targets = (values - self.mean) / self.scale
        self.predictions = self.targets + PREDICTION_NOISE * rng.standard_normal(
            values.shape
        )
        # a set of factors for each number of known values of the predicted pose: none,
        # the yaw's two, or all
        self.factors = {}
        for known in (0, 2, values.shape[1]):
            gram = self._kernel(self.histograms, self.predictions, known)
            # AGARWAL2006 (ridge)
            self.factors[known] = np.linalg.solve(
                gram + ridge * np.eye(samples), self.targets
            )

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a frame for each observation."""
        task = self.task
        latest = list[Array]()
        place = np.array(self.task.anchor, dtype=np.float64)
        for observation in observations:
            if observation.usable or not latest:
                prediction, known = self._predicted(latest)
                masks = [silhouette.mask for silhouette in observation.silhouettes]
                votes = np.concatenate(
                    [histogram(contexts(mask), self.words) for mask in masks]
                )
                estimate = (
                    self._kernel(votes[None], prediction[None], known)
                    @ self.factors[known]
                )[0]
                latest = [*latest, estimate][-2:]
            cosine, sine, *angles = self.mean + self.scale * latest[-1]
            pose = np.array([np.arctan2(sine, cosine), *angles])
            place, drawn = place_of(task, observation, pose, place)
            yield frame_of(task, observation, pose, place, drawn)

    def _predicted(self, latest: list[Array]) -> tuple[Array, int]:
        """Return the predicted numbers, scaled, and how many of them are known."""
        if latest:
            # AGARWAL2006 (prediction)
            return latest[-1] + DAMPING * (latest[-1] - latest[0]), len(self.mean)
        yaw = self.task.yaw
        angles = self.task.first_pose
        pose = np.zeros(66)
        if yaw is not None:
            pose[0] = yaw
        if angles is not None:
            pose[3:] = angles
        known = len(self.mean)
        if yaw is None:
            known = 0
        elif angles is None:
            known = 2
        return (regressed(pose[None])[0] - self.mean) / self.scale, known

    def _kernel(self, histograms: Array, predictions: Array, known: int) -> Array:
        """Return the kernels (n, samples) of silhouettes and predicted poses.

        Only the first `known` numbers of a predicted pose are compared.
        """
        scales = np.sqrt(
            np.repeat([YAW_SHARPNESS / 2, ANGLES_SHARPNESS / 65], [2, 65])
        )[:known]
        squares = squared_distances(
            predictions[:, :known] * scales, self.predictions[:, :known] * scales
        )
        squares += (
            SILHOUETTE_SHARPNESS
            * squared_distances(histograms, self.histograms)
            / self.spread
        )
        return np.asarray(np.exp(-squares))  # AGARWAL2006 (kernel)


def regressed(poses: Array) -> Array:
    """Return the regressed numbers (n, 67): yaw's cosine and sine, the other angles."""
    return np.column_stack([np.cos(poses[:, 0]), np.sin(poses[:, 0]), poses[:, 1:]])
