"""FitImage-v0: one silhouette and few proposals of a pose; what is observed are pictures."""

from functools import partial
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    image_spaces,
)
from posefit_envs.instance import Episode, Image, checked, first_episode, is_held_out
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Evaluation, Rows, prepared

MAX_EVALUATIONS = 8


class FitImageVectorEnv(SearchVectorEnv):
    """`num_envs` environments as FitImageEnv."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        **arguments: Any,
    ) -> None:
        checked(whole, "max_evaluations", max_evaluations, 1)
        super().__init__(num_envs, image_spaces, **arguments)
        self._budget = int(max_evaluations)
        self._best = np.full(num_envs, np.inf)
        self._last: Evaluation | None = None

    def _begin_search(self, i: int, number: int) -> None:
        values, self._truths[i] = prepared(self.world, number, self._budget)
        self._stage.set_values(i, values)
        self._episodes[i] = partial(first_episode, self.world, number, self._budget)
        self._best[i] = np.inf

    def _opened(self, started: Flags) -> tuple[Image, Infos]:
        return self._stage.pictures(), {"instance": self._numbers.copy()}

    def _begun_infos(self, i: int) -> Infos:
        hidden = is_held_out(int(self._numbers[i])) or not self.world.errors
        return {} if hidden else {"truth": self._episode(i).truth}

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        last = self._last = self._stage.evaluate(actions, rows)
        np.minimum(self._best, last.costs, out=self._best, where=stepping)
        truncated = stepping & (self._steps >= self._budget)
        infos = self._progress(
            self._best, self._steps, last.poses, cost=last.costs, areas=last.areas
        )
        common = {"instance": self._numbers}
        return Outcome(
            last.pictures,
            -np.log1p(last.costs),
            np.zeros_like(truncated),
            infos,
            common,
            truncated,
        )

    def _render_row(self, i: int, episode: Episode) -> Picture:
        last = self._last
        if not self._steps[i] or last is None:
            return render_frame(
                episode.problem, None, None, f"instance {episode.instance.number}"
            )
        label = f"cost {last.costs[i]:.1f}, best {self._best[i]:.1f}, {self._steps[i]} evaluations"
        return render_frame(episode.problem, last.poses[i], last.translations[i], label)


class FitImageEnv(SearchEnv):
    """
    ## Description
    A silhouette of a person is observed. Each step proposes a pose; the mismatch of its body with the silhouette is the
    cost. An episode is a few proposals for one silhouette, too few to search blindly: an agent must look.

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning | Min and max stand for |
    |---|---|---|
    | 0, 1, 2 | root yaw, pitch, roll | 45, 15, 15 degrees to either side of a guess |
    | 3, 4, 5 | root translation, with `translation="searched"` only | 0.5 m to either side of a guess |
    | the rest | latents of the prior | the range of its training poses |

    Actions outside are clipped, with one warning. float64 is not rounded.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, for each view:

    | Channel | Meaning |
    |---|---|
    | 0 | the observed silhouette: 255 is the person |
    | 1 | the silhouette of the last proposal; empty before the first |

    ## Rewards
    -ln(1 + cost) of the proposal, whose cost is 0 to 100: SAPSO (4). It needs no normalisation, and as a proposal
    changes nothing but the next picture, a discount `gamma` of 0 learns fastest.

    ## Starting State
    An instance: its number gives the person, the pose, the cadence, the camera, and the guesses. Without
    `instance` each reset draws a number of the `split`; `reset(options={"instance": 17})` chooses one.

    ## Episode End
    Truncates after `max_evaluations` proposals. It never terminates: the end has nothing to do with the silhouette.

    ## Information
    `cost`, `best_cost`, `evaluations`, `areas` (views, 3) R, B, Y in pixels, `instance`, and unless `errors=False`
    `error_degrees` of the proposal against the truth. A reset gives `instance`, and unless `errors=False` `truth` (d,),
    the nearest proposal to the true pose: of training instances only, so that held-out ones have no answer to read.

    ## Arguments
    - `motion="walk"`: a built-in motion, or an .amc or .bvh file; several built-in ones, or "all" kinds of them.
    - `held_out_people=False`: `motion` is then of kinds of built-in motions, and an instance one person's style of it,
      a held-out instance the last person's. By default it is the mean of all styles.
    - `instance=None`: 0 to 19,999. `split="train"` draws of 0 to 9,999, `"test"` of the others, which are held out.
    - `yaw="guessed"`: the root's yaw is known to 20 degrees. "unknown": the person faces anywhere, and the first
      number stands for 180 degrees to either side of facing the first camera.
    - `view_degrees=45.0`: where the camera stands, 0 in front of the person; several for several views.
    - `prior="pca"`, `train=None`: the prior and the motions it learns from; by default other people's.
    - `translation="known"`: or "searched", about a guess up to 0.25 m off in each direction, or "aligned".
    - `size=(64, 48)`: width and height in pixels.
    - `noise=None`: corruptions of the silhouette and their strengths, such as `{"holes": 0.3, "shadow": 0.5}`; see
      `posefit.silhouette.corruption`.
    - `mismatch_percent=0.0`: the largest difference of the fitted body's bones and radii from the person's.
    - `errors=True`: whether infos hold `truth`, and errors against it.
    - `max_evaluations=8`.

    ## Version History
    - v0: not released yet; until then a version changes without a number.
    """

    vector = FitImageVectorEnv
