"""FitImage-v0 and FitState-v0: one silhouette, an episode of proposals; pictures or the search's state are observed."""

from typing import Any

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray

from posefit import PoseProblem
from posefit.arrays import Array
from posefit.fitting.check import finite_number, whole
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    image_spaces,
    log_cost,
    log_improvement,
    scaled,
)
from posefit_envs.instance import Episode, Image, World, checked, first_episode, flag
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Evaluation, Rows

State = NDArray[np.float32]

MAX_EVALUATIONS = 200
TARGET_COST = 2.0
SHOWN = 4  # the best proposals, and the last ones
LOG_STEP = (-2.0, 0.0)  # powers of ten that the last number of an action stands for
MAX_STALE = 50.0  # proposals without an improvement that show as 1


class FitImageVectorEnv(SearchVectorEnv):
    """`num_envs` environments as FitImageEnv."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        target_cost: float = TARGET_COST,
        max_evaluations: int = MAX_EVALUATIONS,
        **arguments: Any,
    ) -> None:
        checked(finite_number, "target_cost", target_cost)
        checked(whole, "max_evaluations", max_evaluations, 2)
        super().__init__(num_envs, image_spaces, **arguments)
        self._target, self._budget = float(target_cost), int(max_evaluations)
        self._best = np.full(num_envs, np.inf)
        self._last: Evaluation | None = None

    @property
    def problems(self) -> list[PoseProblem]:
        """The problem that each environment's proposals are evaluated on."""
        return [episode.problem for episode in self.episodes]

    def _begin_search(self, i: int, number: int) -> None:
        self._enter(i, first_episode(self.world, number, self._budget))
        self._best[i] = np.inf

    def _opened(self, begun: Flags) -> tuple[Image, Infos]:
        return self._stage.pictures(), {"instance": self._numbers.copy()}

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        last = self._last = self._stage.evaluate(actions, rows)
        np.minimum(self._best, last.costs, out=self._best, where=stepping)
        terminated = stepping & (self._best <= self._target)
        truncated = ~terminated & (self._steps >= self._budget)
        infos = self._progress(self._best, self._steps, last.poses, cost=last.costs, areas=last.areas)
        return Outcome(last.pictures, -last.costs, terminated, infos, {"instance": self._numbers}, truncated)

    def _render_row(self, i: int, episode: Episode) -> Picture:
        last = self._last
        if not self._steps[i] or last is None:
            return render_frame(episode.problem, None, None, f"instance {episode.instance.number}")
        label = f"cost {last.costs[i]:.1f}, best {self._best[i]:.1f}, {self._steps[i]} evaluations"
        return render_frame(episode.problem, last.poses[i], last.translations[i], label)


class FitImageEnv(SearchEnv):
    """
    ## Description
    A silhouette of a person is observed. Each step proposes a pose; the mismatch of its body with the silhouette is the
    cost. The episode is a search for the pose.

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning | Min and max stand for |
    |---|---|---|
    | 0, 1, 2 | root yaw, pitch, roll | 45, 15, 15 degrees to either side of a guess |
    | 3, 4, 5 | root translation, with `translation="searched"` only | 0.5 m to either side |
    | the rest | latents of the prior | the range of its training poses |

    Actions outside are clipped, with one warning. float64 is not rounded.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, for each view:

    | Channel | Meaning |
    |---|---|
    | 0 | the observed silhouette: 255 is the person |
    | 1 | the silhouette of the last proposal; empty before the first |

    ## Rewards
    Minus the cost of the proposal, 0 to 100; SAPSO (4).

    ## Starting State
    An instance: its number gives the pose, the cadence, and the middle of the searched yaw. Without
    `instance` each reset draws a number of the `split`; `reset(options={"instance": 17})` chooses one.

    ## Episode End
    Terminates when the best cost is at or below `target_cost`; truncates after `max_evaluations` proposals.

    ## Information
    `cost`, `best_cost`, `evaluations`, `areas` (views, 3) R, B, Y in pixels, `instance`, and unless `errors=False`
    `error_degrees` of the proposal against the truth; a reset gives `instance` alone.

    ## Arguments
    - `motion="walk"`: a built-in motion, or an .amc or .bvh file.
    - `instance=None`: 0 to 19,999. `split="train"` draws of 0 to 9,999, `"test"` of the others, which are held out.
    - `view_degrees=45.0`: where the camera stands, 0 in front of the person; several for several views.
    - `prior="pca"`, `train=None`: the prior and the motions it learns from; by default other people's.
    - `translation="known"`: or "searched" or "aligned".
    - `size=(64, 48)`: width and height in pixels.
    - `noise=None`: corruptions of the silhouette and their strengths, such as `{"holes": 0.3, "shadow": 0.5}`; see
      `posefit.silhouette.corruption`.
    - `mismatch_percent=0.0`: the largest difference of the fitted body's bones and radii from the person's.
    - `errors=True`: whether infos hold errors against the truth.
    - `target_cost=2.0`, `max_evaluations=200`.
    """

    vector = FitImageVectorEnv


class ProposalMemory:
    """The proposals of n searches and their costs, the middle of the box being the first of each.

    `records` (n, 8, d + 1), proposals and their costs, hold the four best, the best first, and the last four, the last
    first. Both begin as four copies of the middle. A copy among the best is replaced only by a proposal that costs less
    than the middle; one among the last by any proposal.
    """

    def __init__(self, searches: int, dimensions: int, evaluations: int) -> None:
        self.records = np.zeros((searches, 2 * SHOWN, dimensions + 1))
        self.used, self.stale = np.zeros((2, searches), dtype=np.int64)
        self.budget = evaluations

    @property
    def best_costs(self) -> Array:
        """The best cost of each search (n,)."""
        return self.records[:, 0, -1]

    @property
    def last(self) -> Array:
        """The last proposal of each search (n, d)."""
        return self.records[:, SHOWN, :-1]

    def begin(self, rows: Flags, costs: Array) -> None:
        """Begin some searches with the costs (n,) of the middle of the box."""
        self.records[rows, :, :-1], self.records[rows, :, -1] = 0.0, costs[rows, None]
        self.used[rows], self.stale[rows] = 1, 0

    def proposals(self, actions: Array) -> Array:
        """Return the proposals (n, d) of actions (n, d + 1): a part of the way from the best to their first numbers.

        Where the last number is 1 the proposal is the first numbers, bit for bit.
        """
        targets, powers, best = actions[:, :-1], actions[:, -1:], self.records[:, 0, :-1]
        parts = np.array([[10.0 ** scaled(LOG_STEP, power)] for power in actions[:, -1].tolist()])
        return np.where(powers >= 1.0, targets, best + parts * (targets - best))

    def add(self, proposals: Array, costs: Array) -> None:
        """Remember a proposal of each search (n, d) and its cost (n,)."""
        records = self.records
        self.used += 1
        self.stale = np.where(costs < self.best_costs, 0, self.stale + 1)
        records[:, SHOWN + 1 :] = records[:, SHOWN:-1]
        records[:, SHOWN, :-1], records[:, SHOWN, -1] = proposals, costs
        for i in (costs < records[:, SHOWN - 1, -1]).nonzero()[0].tolist():
            place = int(records[i, :SHOWN, -1].searchsorted(costs[i], side="right"))
            records[i, place + 1 : SHOWN] = records[i, place : SHOWN - 1]
            records[i, place] = records[i, SHOWN]

    def states(self) -> State:
        """Return the observations (n, 8 d + 10): the best proposals, the last ones, their costs, the budget left."""
        points, costs = self.records[:, :, :-1], self.records[:, :, -1]
        left = 2.0 * (1.0 - self.used / self.budget) - 1.0
        stale = 2.0 * np.minimum(self.stale / MAX_STALE, 1.0) - 1.0
        rows = points.reshape(len(left), -1), 2.0 * log_cost(costs) - 1.0, left[:, None], stale[:, None]
        return np.concatenate(rows, axis=1, dtype=np.float32, casting="same_kind")


class FitStateVectorEnv(SearchVectorEnv):
    """`num_envs` environments as FitStateEnv."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        image: bool = False,
        **arguments: Any,
    ) -> None:
        checked(whole, "max_evaluations", max_evaluations, 2)
        image = flag("image", image)

        def search_spaces(world: World) -> tuple[spaces.Box, Space[Any]]:
            d = world.dimensions
            state = spaces.Box(-1.0, 1.0, (2 * SHOWN * (d + 1) + 2,), np.float32)
            both = spaces.Dict({"search": state, "image": image_spaces(world)[1]}) if image else state
            return spaces.Box(-1.0, 1.0, (d + 1,), np.float32), both

        super().__init__(num_envs, search_spaces, **arguments)
        self._budget, self._image = int(max_evaluations), image
        self._memory = ProposalMemory(num_envs, self.world.dimensions, self._budget)
        self._last: Evaluation | None = None

    def _begin_search(self, i: int, number: int) -> None:
        self._enter(i, first_episode(self.world, number, self._budget))

    def _opened(self, begun: Flags) -> tuple[Any, Infos]:
        # environments that go on show their last proposal once more, without counting it
        evaluation = self._evaluate(np.where(begun[:, None], 0.0, self._memory.last))
        self._memory.begin(begun, evaluation.costs)
        return self._observations(evaluation), self._infos(evaluation)

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        memory, some_begin = self._memory, len(rows) < self.num_envs
        proposals = memory.proposals(actions)
        if some_begin:
            proposals[~stepping] = 0.0  # the middle of the box
        evaluation = self._evaluate(proposals)
        before = memory.best_costs.copy()
        memory.add(proposals, evaluation.costs)
        if some_begin:
            memory.begin(~stepping, evaluation.costs)
        terminated = stepping & (memory.used >= self._budget)
        infos = self._infos(evaluation)
        rewards = log_improvement(before, memory.best_costs)
        return Outcome(self._observations(evaluation), rewards, terminated, infos, infos)

    def _evaluate(self, proposals: Array) -> Evaluation:
        self._last = self._stage.evaluate(proposals, self._stage.all_rows)
        return self._last

    def _observations(self, evaluation: Evaluation) -> Any:
        states = self._memory.states()
        return {"search": states, "image": evaluation.pictures} if self._image else states

    def _infos(self, last: Evaluation) -> Infos:
        memory = self._memory
        return self._progress(memory.best_costs, memory.used, last.poses, cost=last.costs, areas=last.areas)

    def _render_row(self, i: int, episode: Episode) -> Picture:
        memory, last = self._memory, self._last
        assert last is not None
        label = f"cost {last.costs[i]:.1f}, best {memory.best_costs[i]:.1f}, {memory.used[i]} evaluations"
        return render_frame(episode.problem, last.poses[i], last.translations[i], label)


class FitStateEnv(SearchEnv):
    """
    ## Description
    As `FitImage-v0`, but the observation holds what a search needs: the best proposals so far and the last ones, with
    their costs.

    ## Action Space
    `Box(-1, 1, (d + 1,), float32)`, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning |
    |---|---|
    | 0 to d - 1 | the target: a proposal, as in `FitImage-v0` |
    | d | the fraction of the way from the best proposal so far to the target, by powers of ten from 0.01 to 1 |

    At 1 the target itself is proposed, bit for bit, and at 0 the point a tenth of the way there. Actions outside are
    clipped, with one warning. float64 is not rounded.

    ## Observation Space
    `Box(-1, 1, (8 d + 10,), float32)`; with `image=True` a `Dict` of it as `search` and the picture of `FitImage-v0` as
    `image`.

    | Num | Meaning |
    |---|---|
    | 0 to 4 d - 1 | the four best proposals of those that cost less than the middle of the box, the best first |
    | 4 d to 8 d - 1 | the last four proposals, the last first |
    | 8 d to 8 d + 7 | the costs of these eight: 2 ln(1 + cost) / ln 101 - 1 |
    | 8 d + 8 | budget left: from 1 to -1 |
    | 8 d + 9 | proposals since the best cost fell: from -1 to 1 for 50 or more |

    Both lists begin as four copies of the middle of the box, with its cost. Of proposals that cost the same the earlier
    one is the better.

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)): 0 where the proposal is no better than the best so far.

    ## Starting State
    An instance, as in `FitImage-v0`. The middle of the box is proposed first, as the first of `max_evaluations`.

    ## Episode End
    Terminates after `max_evaluations` proposals.

    ## Information
    `cost`, `best_cost`, `evaluations`, `areas` (views, 3) R, B, Y in pixels, `instance`, and unless `errors=False`
    `error_degrees` of the proposal against the truth; a reset too, of the middle of the box.

    ## Arguments
    As in `FitImage-v0`, with `image=False`, and without `target_cost`.
    """

    vector = FitStateVectorEnv
