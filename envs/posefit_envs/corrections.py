"""FitImage-v1 for learners: small pictures, and actions that correct a proposal."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import error
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit_envs.base import Flags, Infos

if TYPE_CHECKING:
    Wrapper = VectorWrapper[Any, Any, Any, Any, Any]
else:
    Wrapper = VectorWrapper  # generic only since Gymnasium 1.4

Features = NDArray[np.float32]

# side, in pixels, of the blocks whose means are the pixels of the small pictures
BLOCK = 4
# largest correction, in half-ranges of the box; the first action spans the whole box
REACH = 0.3
# an observation counts at most this many corrections since the best proposal
MOST_FAILURES = 4


class Corrections(Wrapper):
    """A vector of FitImage-v1 in which actions correct the best proposal so far.

    Proposals of poses are hard to get right from a picture alone. A correction of a
    proposal that is near the truth is easier, if its silhouette is shown with the
    observed one. This wrapper remembers the best proposal of each episode, shows where
    its silhouette differs, and adds the action to it.

    Actions are corrections in [-1, 1]^d. The first is the first proposal itself. Later
    ones are multiplied by 0.3 half-ranges of the box, and by a half for each correction
    since the best proposal, so that steps shrink while nothing improves. Proposals are
    clipped to the box; an unknown yaw wraps around instead.

    Observations have 2 p + d + 2 numbers of -1 to 1:

    | numbers | meaning |
    |---|---|
    | p | the observed silhouette, as means of 4 x 4 pixels, 0 to 1 |
    | p | the same, less the silhouette of the best proposal |
    | d | the best proposal; zeros before the first |
    | 1 | 1 before the first proposal, else 0 |
    | 1 | corrections since the best proposal, 0 to 4, / 4 |

    Infos, rewards and problems are those of the wrapped environment. `best` of each
    problem is the best proposal of that episode.

    Args:
        env: A vector of FitImage-v1, native or not, without other wrappers of
            observations. Its autoreset mode must not be SAME_STEP.

    Raises:
        gymnasium.error.Error: If the environment is of another kind or mode, or its
            pictures cannot be divided into blocks of 4 x 4 pixels.

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import Corrections
        >>> env = Corrections(gym.make_vec("posefit_envs:posefit/FitImage-v1", 2))
        >>> observations, infos = env.reset(seed=0)
        >>> observations.shape, env.single_action_space.shape
        ((2, 395), (9,))
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        pictures = env.single_observation_space.shape or ()
        proposals = env.single_action_space.shape or ()
        if len(pictures) != 3 or len(proposals) != 1:
            raise error.Error(
                f"env must be posefit/FitImage-v1, got pictures of shape {pictures}"
            )
        if pictures[0] % BLOCK or pictures[1] % BLOCK:
            raise error.Error(
                f"sizes must be divisible by {BLOCK}, got pictures of shape {pictures}"
            )
        mode = AutoresetMode(env.metadata["autoreset_mode"])
        # that mode hides the last proposal's picture behind the next episode's first
        if mode is AutoresetMode.SAME_STEP:
            raise error.Error("autoreset_mode must be NextStep or Disabled")
        count = env.num_envs
        (dimensions,) = proposals
        pixels = int(np.prod(pictures)) // (2 * BLOCK**2)
        self.single_observation_space = Box(
            -1.0, 1.0, (2 * pixels + dimensions + 2,), np.float32
        )
        self.observation_space = batch_space(self.single_observation_space, count)
        worlds = env.unwrapped.get_attr("world")  # type: ignore[attr-defined]
        self._yaw_wraps = worlds[0].yaw == "unknown"
        self._observed = np.zeros((count, pixels), dtype=np.float32)
        self._best = np.zeros((count, dimensions))
        self._best_drawn = np.zeros((count, pixels), dtype=np.float32)
        self._best_costs = np.full(count, np.inf)
        self._failures = np.zeros(count)

    def reset(
        self,
        *,
        seed: Any = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Features, Infos]:
        """Return the first observations (n, 2 p + d + 2) of new episodes, and infos.

        Args:
            seed: Seed of the environment.
            options: Options of the environment.
        """
        pictures, infos = self.env.reset(seed=seed, options=options)
        everyone = np.ones(self.num_envs, dtype=bool)
        self._begin((options or {}).get("reset_mask", everyone), pictures)
        return self._observations(), infos

    def step(self, actions: Any) -> tuple[Features, Array, Flags, Flags, Infos]:
        """Return what the environment returns for the best proposals, corrected.

        Args:
            actions: The corrections (n, d) in [-1, 1].

        Returns:
            Observations (n, 2 p + d + 2), rewards (n,), two flags (n,), terminated and
            truncated, and infos.
        """
        proposals = self.proposals(np.asarray(actions, dtype=np.float64))
        pictures, rewards, terminated, truncated, infos = self.env.step(proposals)
        # under NEXT_STEP an ended row begins an episode, and its proposal is not used
        begun = np.asarray(infos["evaluations"]) == 0
        better = (infos["cost"] < self._best_costs) & ~begun
        self._best[better] = proposals[better]
        self._best_drawn[better] = shrunk(pictures[better, ..., 1::2])
        self._best_costs[better] = infos["cost"][better]
        self._failures = np.where(better, 0.0, self._failures + 1.0)
        if begun.any():
            self._begin(begun, pictures)
        return self._observations(), rewards, terminated, truncated, infos

    def proposals(self, actions: Array) -> Array:
        """Return the proposals (n, d) of actions (n, d), without a step."""
        first = np.isinf(self._best_costs)
        reach = np.where(first, 1.0, REACH * 0.5**self._failures)
        proposals = self._best + reach[:, None] * np.clip(actions, -1.0, 1.0)
        if self._yaw_wraps:
            proposals[:, 0] = (proposals[:, 0] + 1.0) % 2.0 - 1.0
        clipped: Array = np.clip(proposals, -1.0, 1.0)
        return clipped

    def _begin(self, rows: Flags, pictures: Any) -> None:
        """Forget the proposals of some rows, and store their new silhouettes."""
        self._observed[rows] = shrunk(pictures[rows, ..., ::2])
        self._best[rows] = 0.0
        self._best_drawn[rows] = 0.0
        self._best_costs[rows] = np.inf
        self._failures[rows] = 0.0

    def _observations(self) -> Features:
        first = np.isinf(self._best_costs)
        return features(
            self._observed, self._best_drawn, self._best, first, self._failures
        )


def features(
    observed: Features, drawn: Features, best: Array, first: Flags, failures: Array
) -> Features:
    """Return the observations (n, 2 p + d + 2) of an agent; see `Corrections`.

    Args:
        observed: The observed silhouettes (n, p), shrunk.
        drawn: The silhouettes of the best proposals (n, p); zeros before the first.
        best: The best proposals (n, d).
        first: Which rows (n,) have no proposal yet.
        failures: The corrections (n,) since the best proposals.
    """
    shown_failures = np.minimum(failures, MOST_FAILURES) / MOST_FAILURES
    seen = [
        observed, observed - drawn, best, first[:, None], shown_failures[:, None]
    ]  # fmt: skip
    return np.concatenate(seen, axis=1, dtype=np.float32)


def shrunk(pictures: Any) -> Features:
    """Return silhouettes (n, height, width, views) as small pictures (n, p).

    Each number is the mean of 4 x 4 pixels, 0 to 1.
    """
    count, height, width, views = pictures.shape
    blocks = pictures.reshape(
        count, height // BLOCK, BLOCK, width // BLOCK, BLOCK, views
    )
    # sums of rows first: two small sums are faster than one over two axes
    sums = blocks.sum(axis=2, dtype=np.uint16).sum(axis=3, dtype=np.uint16)
    whole = np.float32(255 * BLOCK**2)
    small = sums.reshape(count, math.prod(sums.shape[1:]))
    return np.asarray(small / whole, dtype=np.float32)
