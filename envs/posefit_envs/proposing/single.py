"""Fit-v1: one silhouette, an episode of proposals, and an observation that says what was proposed before."""

from typing import Any, Unpack

import numpy as np
from gymnasium import Space, error, spaces

from posefit import SearchSpace
from posefit.fitting.check import whole
from posefit_envs.base import SearchEnv
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import MAX_EVALUATIONS, Episode, action_shape, spaces_of
from posefit_envs.instance import ArgumentError, Arguments, World, approved, select
from posefit_envs.proposing.memory import ProposalMemory, seen_with, space_of_memory
from posefit_envs.stage import Stage


class ProposalEnv(SearchEnv[Episode]):
    """
    ## Description
    A person was seen as a silhouette. Each step proposes a pose; its body is projected, and what does not overlap with
    the silhouette is its cost. The episode is a search for the pose, and the observation says enough to search with:
    the best proposals so far and the last ones, with their costs.

    ## Action Space
    `Box(-1, 1, (d + 1,), float32)`, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning |
    |---|---|
    | 0 to d - 1 | where to: a proposal, as in `Fit-v0` |
    | d | how much of the way there from the best proposal so far, by powers of ten from 0.01 to 1 |

    Where the last number is 1 the first numbers are proposed, bit for bit; at 0 a tenth of the way is gone.
    So every proposal lies in the box. Actions outside are clipped, with one warning. float64 is not rounded.

    ## Observation Space
    `Box(-1, 1, (8 d + 10,), float32)`; with `image=True` a `Dict` of it as `search` and the picture of `Fit-v0` as
    `image`.

    | Num | Meaning |
    |---|---|
    | 0 to 4 d - 1 | the four best proposals of those that cost less than the middle of the box, the best first |
    | 4 d to 8 d - 1 | the last four proposals, the last first |
    | 8 d to 8 d + 7 | what these eight cost: 2 ln(1 + cost) / ln 101 - 1 |
    | 8 d + 8 | budget left: from 1 to -1 |
    | 8 d + 9 | proposals since the best cost fell: from -1 to 1 for 50 or more |

    Both fours begin as four copies of the middle of the box, with its cost. So what costs as much or more is never
    among the best, where copies fill the places behind those that cost less; among the last they stand behind the first
    three proposals. Of proposals that cost the same the earlier one is the better.

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)): 0 where the proposal is no better than the best so far. The sum
    over an episode is by what factor the cost of the middle of the box came down.

    ## Starting State
    An instance, as in `Fit-v0`. The middle of the box is proposed first, as the first of `max_evaluations`.

    ## Episode End
    Terminates after `max_evaluations` proposals. There is no target. It is never truncated.

    ## Information
    `cost`, `best_cost`, `evaluations`, `areas` (views, 3) R, B, Y in pixels, `instance`, and unless `errors=False`
    `error_degrees` of the proposal against the truth; a reset too, of the middle of the box.

    ## Arguments
    As in `Fit-v0`, with `image=False`, and without `target_cost`.

    ## Version History
    - v1: the observation is the search and no picture; the action has a part of the way; the reward is a fall of the
      logarithm of the best cost, and was minus the cost; the middle of the box is proposed first; no target ends it.
    - v0: `posefit/Fit-v0`, which stays as it is.
    """

    def __init__(
        self,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        image: bool = False,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_proposing(max_evaluations, image)
        selection = select(**arguments)
        super().__init__(selection, spaces_of_proposing(selection.world, image), render_mode)
        self._most, self._image, self._dimensions = int(max_evaluations), image, self._shape[0] - 1
        self._stage = Stage(self.world, 1)

    @property
    def search_space(self) -> SearchSpace:
        """The space of the current instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        episode = self._search = Episode(self.world, number, self._most)
        self._stage.put(0, episode.scenery, episode.space)
        outcome = self._stage.look(np.zeros((1, self._dimensions)), self._stage.everyone)
        info = episode.take(outcome, self._selection.errors)
        self._memory = ProposalMemory(self._dimensions, episode.cost, self._most)
        self._show()
        return seen_with(self._memory.state(), outcome.pictures[0], self._image), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Propose a pose."""
        episode = self._current()
        if episode.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._memory.proposal(self._door.proposals(action, self._shape))
        outcome = self._stage.look(proposal[None], self._stage.everyone)
        info = episode.take(outcome, self._selection.errors)
        reward = self._memory.take(proposal, episode.cost)
        episode.ended = episode.evaluations >= self._most
        self._show()
        seen = seen_with(self._memory.state(), outcome.pictures[0], self._image)
        return seen, reward, episode.ended, False, info

    def _portrait(self, search: Episode) -> Picture:
        return portray(search.scenery, search.pose, search.translation, search.label)


def spaces_of_proposing(world: World, image: bool) -> tuple[spaces.Box, Space[Any]]:
    """Return the action space and the observation space of a world, with the picture or without."""
    d = action_shape(world)[0]
    shown = space_of_memory(d)
    seen = spaces.Dict({"search": shown, "image": spaces_of(world)[1]}) if image else shown
    return spaces.Box(-1.0, 1.0, (d + 1,), np.float32), seen


def check_proposing(max_evaluations: Any, image: Any) -> None:
    """Return nothing. Raises ArgumentError where an argument makes no sense."""
    approved(whole, "max_evaluations", max_evaluations, 2)
    if not isinstance(image, bool):
        raise ArgumentError(f"image must be true or false, got {image!r}")
