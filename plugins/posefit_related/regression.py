"""Poses from silhouettes by regression: no body is drawn to fit a frame.

A. Agarwal, B. Triggs, Recovering 3D human pose from monocular images, IEEE Trans. Pattern Analysis and Machine
Intelligence 28(1), 2006. A silhouette is a histogram of shape contexts: those of the points of its border, as votes for
the centres of a codebook. Poses are regressed by kernels on a training set of rendered poses; in a sequence, a
predicted pose joins the silhouette, since one silhouette may be of several poses.

Interpretations: damped least squares over a kernel at every training pose, where the publication prefers a relevance
vector machine for its sparseness; a product of kernels of silhouette and predicted pose; several views side by side. To
render training poses counts in no frame's budget.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, Frame, Observation, Task, at_least, positive, project
from posefit_related.frames import frame_of, place_of, squared_distances, training_poses

POINTS, ANGLES, RADII = 80, 12, 5  # ours: of a border and of a shape context
YAW_REACH = np.radians(90.0)  # ours: of training poses to either side of a known first yaw
VOTES, STATE_NOISE = 0.25, 0.5  # ours: widths of a vote, in usual distances, and of a prediction, in deviations
DAMPING, SHARPNESS = 0.5, (3.0, 0.3, 0.5)  # ours: of velocity; of the kernel in silhouette, yaw, and other angles


def contexts(mask: NDArray[np.bool_]) -> Array:
    """Return the shape contexts (n, 60) of points on a mask's border: where its other points are, around each."""
    padded = np.pad(np.asarray(mask, dtype=bool), 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    points = np.argwhere(padded[1:-1, 1:-1] & ~inner).astype(np.float64)
    if len(points) < 3:
        return np.zeros((1, ANGLES * RADII))
    points = points[np.linspace(0, len(points) - 1, min(POINTS, len(points))).astype(int)]
    away = points[None] - points[:, None]
    far = np.hypot(*np.moveaxis(away, 2, 0))
    ring = np.clip(np.log2(far / far.mean() + 1e-9) + RADII - 1.5, 0.0, RADII - 1.0).astype(int)
    sector = ((np.arctan2(away[..., 0], away[..., 1]) + np.pi) * ANGLES / (2.0 * np.pi)).astype(int) % ANGLES
    bins = ring * ANGLES + sector + ANGLES * RADII * np.arange(len(points))[:, None]
    others = bins[~np.eye(len(points), dtype=bool)]
    counts = np.bincount(others, minlength=ANGLES * RADII * len(points)).reshape(len(points), -1)
    return np.asarray(counts / (len(points) - 1.0))  # AGARWAL2006 (shape context)


def histogram(shapes: Array, words: Array) -> Array:
    """Return the votes (k,) of contexts (n, 60) for the words (k, 60) of a codebook; they sum to 1."""
    squares = squared_distances(shapes, words)
    squares -= squares.min(axis=1, keepdims=True)
    votes = np.exp(-squares / (2.0 * (VOTES * np.sqrt(squares.mean()) + 1e-9) ** 2))
    return np.asarray((votes / votes.sum(axis=1, keepdims=True)).mean(axis=0))  # AGARWAL2006 (histogram)


class Regression:
    """Kernel regression from silhouettes, and in a sequence also from the predicted pose.

    Settings:
        samples: training poses, each at a random yaw, 10 or more.
        words: of the codebook, 2 or more.
        ridge: of the regression, above 0.
    """

    def __init__(self, task: Task, *, samples: int = 1200, words: int = 100, ridge: float = 0.02) -> None:
        from sklearn.cluster import MiniBatchKMeans

        at_least("samples", samples, 10)
        at_least("words", words, 2)
        positive("ridge", ridge)
        self.task, rng = task, np.random.default_rng(0)
        poses = training_poses(task)
        poses = poses[rng.integers(len(poses), size=samples)]
        poses[:, 0] = rng.uniform(-1.0, 1.0, samples) * (np.pi if task.yaw is None else YAW_REACH) + (task.yaw or 0.0)
        shapes = [[contexts(project(task.body, view, pose, task.anchor)) for pose in poses] for view in task.cameras]
        some = np.concatenate([part for view in shapes for part in view[:: max(samples // 200, 1)]])
        self.words = MiniBatchKMeans(min(words, len(some)), n_init=1, random_state=0).fit(some).cluster_centers_
        signs = np.concatenate([[histogram(part, self.words) for part in view] for view in shapes], axis=1)
        values = numbers(poses)
        self.mean, self.scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-3)
        self.targets, self.signs = (values - self.mean) / self.scale, signs
        self.states = self.targets + STATE_NOISE * rng.standard_normal(values.shape)
        self.width = float(((signs - signs.mean(axis=0)) ** 2).sum(axis=1).mean())
        self.factors = {}  # by how many numbers of the predicted pose are known: none, two of the yaw, or all
        for known in (0, 2, values.shape[1]):
            gram = self._kernel(signs, self.states, known)
            self.factors[known] = np.linalg.solve(gram + ridge * np.eye(samples), self.targets)  # AGARWAL2006 (ridge)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a frame for each observation."""
        task, latest, place = self.task, list[Array](), np.array(self.task.anchor, dtype=np.float64)
        for observation in observations:
            if observation.usable or not latest:
                state, known = self._predicted(latest)
                masks = [silhouette.mask for silhouette in observation.silhouettes]
                sign = np.concatenate([histogram(contexts(mask), self.words) for mask in masks])
                value = (self._kernel(sign[None], state[None], known) @ self.factors[known])[0]
                latest = [*latest, value][-2:]
            value = self.mean + self.scale * latest[-1]
            pose = np.append(np.arctan2(value[1], value[0]), value[2:])
            place, drawn = place_of(task, observation, pose, place)
            yield frame_of(task, observation, pose, place, drawn)

    def _predicted(self, latest: list[Array]) -> tuple[Array, int]:
        """Return the predicted numbers, scaled, and how many of them are known."""
        if latest:
            return latest[-1] + DAMPING * (latest[-1] - latest[0]), len(self.mean)  # AGARWAL2006 (prediction)
        yaw, angles = self.task.yaw, self.task.first_pose
        pose = np.concatenate([[yaw or 0.0, 0.0, 0.0], np.zeros(63) if angles is None else angles])
        known = 0 if yaw is None else 2 if angles is None else len(self.mean)
        return (numbers(pose[None])[0] - self.mean) / self.scale, known

    def _kernel(self, signs: Array, states: Array, known: int) -> Array:
        """Return the kernels (n, samples) of silhouettes, and of the first `known` numbers of predicted poses."""
        scales = np.sqrt(np.repeat([SHARPNESS[1] / 2, SHARPNESS[2] / 65], [2, 65]))[:known]
        squares = squared_distances(states[:, :known] * scales, self.states[:, :known] * scales)
        squares += SHARPNESS[0] * squared_distances(signs, self.signs) / self.width
        return np.asarray(np.exp(-squares))  # AGARWAL2006 (kernel)


def numbers(poses: Array) -> Array:
    """Return what is regressed (n, 67): the yaw's cosine and sine, so that it may turn, and the other angles."""
    return np.column_stack([np.cos(poses[:, 0]), np.sin(poses[:, 0]), poses[:, 1:]])
