"""FitState-v0: one silhouette, an episode of proposals, and the state of the search as observation."""

from typing import Any, Unpack

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    VectorArguments,
    image_spaces,
    proposal_dimensions,
)
from posefit_envs.fit_image import MAX_EVALUATIONS
from posefit_envs.instance import ArgumentError, Episode, World, checked, first_episode
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.scales import log_cost, log_improvement, scaled
from posefit_envs.stage import Evaluation, Rows

State = NDArray[np.float32]

SHOWN = 4  # the best proposals, and the last ones
LOG_STEP = (-2.0, 0.0)  # powers of ten that the last number of an action stands for
MAX_STALE = 50.0  # proposals without an improvement that show as 1


class ProposalMemory:
    """The proposals of one search and their costs, the middle of the box being the first.

    `best` and `last` hold four proposals each and begin as four copies of the middle. A copy among the best is replaced
    only by a proposal that costs less than the middle; one among the last by any proposal.
    """

    def __init__(self, dimensions: int, cost: float, evaluations: int) -> None:
        self.best = np.zeros((SHOWN, dimensions))
        self.best_costs = np.full(SHOWN, cost)
        self.last, self.last_costs = self.best.copy(), self.best_costs.copy()
        self.used, self.stale, self.budget = 1, 0, evaluations

    def proposal(self, action: Array) -> Array:
        """Return the proposal (d,) of an action (d + 1,): a part of the way from the best so far to its first numbers.

        Where the last number is 1 the proposal is the first numbers, bit for bit.
        """
        target, power = action[:-1], float(action[-1])
        if power >= 1.0:
            return np.array(target)
        proposed: Array = self.best[0] + 10.0 ** scaled(LOG_STEP, power) * (target - self.best[0])
        return proposed

    def add(self, proposal: Array, cost: float) -> float:
        """Remember a proposal (d,) and its cost, and return the logarithmic improvement of the best cost."""
        before = float(self.best_costs[0])
        self.used += 1
        self.stale = 0 if cost < before else self.stale + 1
        self.last = np.concatenate([proposal[None], self.last[:-1]])
        self.last_costs = np.concatenate([[cost], self.last_costs[:-1]])
        place = int(np.searchsorted(self.best_costs, cost, side="right"))
        if place < SHOWN:
            self.best = np.insert(self.best, place, proposal, axis=0)[:SHOWN]
            self.best_costs = np.insert(self.best_costs, place, cost)[:SHOWN]
        return log_improvement(before, float(self.best_costs[0]))

    def state(self) -> State:
        """Return the observation (8 d + 10,): the best proposals, the last ones, their costs, and the budget left."""
        costs = 2.0 * log_cost(np.concatenate([self.best_costs, self.last_costs])) - 1.0
        ends = [2.0 * (1.0 - self.used / self.budget) - 1.0, 2.0 * min(self.stale / MAX_STALE, 1.0) - 1.0]
        shown = np.concatenate([self.best.ravel(), self.last.ravel(), costs, ends])
        state: State = np.clip(shown, -1.0, 1.0).astype(np.float32)
        return state


class FitStateVectorEnv(SearchVectorEnv):
    """`num_envs` environments as FitStateEnv."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        image: bool = False,
        **arguments: Unpack[VectorArguments],
    ) -> None:
        checked(whole, "max_evaluations", max_evaluations, 2)
        if not isinstance(image, bool):
            raise ArgumentError(f"image must be true or false, got {image!r}")

        def search_spaces(world: World) -> tuple[spaces.Box, Space[Any]]:
            d = proposal_dimensions(world)
            state = spaces.Box(-1.0, 1.0, (2 * SHOWN * (d + 1) + 2,), np.float32)
            both = spaces.Dict({"search": state, "image": image_spaces(world)[1]}) if image else state
            return spaces.Box(-1.0, 1.0, (d + 1,), np.float32), both

        super().__init__(num_envs, search_spaces, **arguments)
        self._budget, self._image, self._dimensions = int(max_evaluations), image, self._shape[1] - 1
        self._memories = [ProposalMemory(self._dimensions, np.inf, self._budget) for _ in range(num_envs)]
        self._best, self._used = np.empty(num_envs), np.zeros(num_envs, dtype=np.int64)
        self._last: Evaluation | None = None

    def _begin_search(self, i: int, number: int) -> None:
        self._enter(i, first_episode(self.world, number, self._budget))

    def _opened(self, begun: Flags) -> tuple[Any, Infos]:
        # environments that go on show their last proposal once more, without counting it
        last = np.stack([memory.last[0] for memory in self._memories])
        evaluation = self._evaluate(np.where(begun[:, None], 0.0, last), begun)
        return self._observations(evaluation), self._infos(evaluation)

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        proposals = np.zeros((self.num_envs, self._dimensions))  # the middle of the box where an episode begins
        for i in rows.tolist():
            proposals[i] = self._memories[i].proposal(actions[i])
        evaluation = self._evaluate(proposals, ~stepping)
        rewards = np.zeros(self.num_envs)
        for i in rows.tolist():
            memory = self._memories[i]
            rewards[i] = memory.add(proposals[i], float(evaluation.costs[i]))
            self._best[i], self._used[i] = memory.best_costs[0], memory.used
        terminated = stepping & (self._used >= self._budget)
        infos = self._infos(evaluation)
        never = np.zeros_like(terminated)
        return Outcome(self._observations(evaluation), rewards, terminated, never, infos, infos)

    def _evaluate(self, proposals: Array, begun: Flags) -> Evaluation:
        """Evaluate proposals (n, d); in environments that have begun they are the first ones."""
        evaluation = self._last = self._stage.evaluate(proposals, self._stage.all_rows)
        for i in np.flatnonzero(begun).tolist():
            self._memories[i] = ProposalMemory(self._dimensions, float(evaluation.costs[i]), self._budget)
            self._best[i], self._used[i] = evaluation.costs[i], 1
        return evaluation

    def _observations(self, evaluation: Evaluation) -> Any:
        states = np.array([memory.state() for memory in self._memories])
        return {"search": states, "image": evaluation.pictures} if self._image else states

    def _infos(self, evaluation: Evaluation) -> Infos:
        infos = {"cost": evaluation.costs, "areas": evaluation.areas}
        return infos | self._progress(self._best.copy(), self._used.copy(), lambda: evaluation.poses)

    def _render_row(self, i: int, episode: Episode) -> Picture:
        memory, last = self._memories[i], self._last
        assert last is not None
        label = f"cost {last.costs[i]:.1f}, best {memory.best_costs[0]:.1f}, {memory.used} evaluations"
        return render_frame(episode.scenery, last.poses[i], last.translations[i], label)


class FitStateEnv(SearchEnv):
    """
    ## Description
    A silhouette of a person is observed. Each step proposes a pose; its body is projected, and its mismatch with the
    silhouette is the cost. The episode is a search for the pose, and the observation holds what a search needs: the
    best proposals so far and the last ones, with their costs.

    ## Action Space
    `Box(-1, 1, (d + 1,), float32)`, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning |
    |---|---|
    | 0 to d - 1 | the target: a proposal, as in `FitImage-v0` |
    | d | the fraction of the way from the best proposal so far to the target, by powers of ten from 0.01 to 1 |

    Where the last number is 1 the target is proposed, bit for bit; where it is 0, the point a tenth of the way there.
    So every proposal lies in the box. Actions outside are clipped, with one warning. float64 is not rounded.

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

    Both lists begin as four copies of the middle of the box, with its cost. So a proposal that costs as much or more is
    never among the best, where copies fill the remaining places; among the last they follow the first three proposals.
    Of proposals that cost the same the earlier one is the better.

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)): 0 where the proposal is no better than the best so far. The sum
    over an episode is the logarithm of the factor by which the cost of the middle of the box fell.

    ## Starting State
    An instance, as in `FitImage-v0`. The middle of the box is proposed first, as the first of `max_evaluations`.

    ## Episode End
    Terminates after `max_evaluations` proposals. There is no target. It is never truncated.

    ## Information
    `cost`, `best_cost`, `evaluations`, `areas` (views, 3) R, B, Y in pixels, `instance`, and unless `errors=False`
    `error_degrees` of the proposal against the truth; a reset too, of the middle of the box.

    ## Arguments
    As in `FitImage-v0`, with `image=False`, and without `target_cost`.
    """

    vector = FitStateVectorEnv
