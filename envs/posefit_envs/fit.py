"""FitImage-v1: a few proposals of the pose in one silhouette; observed as pictures."""

from functools import partial
from typing import Any

import numpy as np

from posefit import Problem, Problems, SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.base import (
    Flags,
    Infos,
    SearchEnv,
    SearchVectorEnv,
    image_spaces,
    infos_before,
    proposal_infos,
    reward_of_cost,
    row_of,
)
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows, Stage, first_scene, first_scenes
from posefit_envs.world import (
    FirstFrame,
    Image,
    checked,
    first_problem,
    first_truth,
)

MAX_EVALUATIONS = 8


class FitImageEnv(SearchEnv):
    """
    ## Description
    The observation shows the silhouette of a person. Each step proposes a pose; its
    cost is the mismatch between the silhouette and the proposed body. An episode is a
    few proposals for one silhouette. These are too few for a search that learns only
    the costs: an agent must use the picture.

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal. With `prior="pca"` and a known translation,
    d = 9.

    | Num | Meaning | -1 and 1 mean |
    |---|---|---|
    | 0, 1, 2 | root yaw, pitch, roll | 45, 15, 15 degrees to either side of a guess |
    | 3, 4, 5 | root translation if `translation="searched"` | 0.5 m around a guess |
    | the rest | latents of the prior | the range of its training poses |

    Actions outside the box are clipped, with one warning. float64 actions are not
    rounded.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, for each view:

    | Channel | Meaning |
    |---|---|
    | 0 | the observed silhouette: 255 is the person |
    | 1 | the silhouette of the last proposal; empty before the first |

    ## Rewards
    -ln(1 + cost) of the proposal, with a cost of 0 to 100: SAPSO (4). It needs no
    normalisation. A proposal changes only the next picture, so a discount `gamma` of 0
    learns fastest.

    ## Starting State
    An instance. Its number determines the person, the pose, the cadence, the camera,
    and the guesses. Without `instance` each reset draws a number of the `split`;
    `reset(options={"instance": 17})` chooses one.

    ## Episode End
    Terminates after `max_evaluations` proposals. Only a time limit of Gymnasium
    truncates. The number of proposals left is not in the pictures, but in the infos.

    ## Information
    A step and a reset give `cost`, `best_cost`, `evaluations`, `remaining_steps`,
    `areas` (views, 3) R, B, Y in pixels, and `instance`. In training they also give
    `truth` (d,), the proposal nearest to the true pose, and `error_degrees`, the error
    of the last proposal's pose, unless `errors=False`. The test split gives neither,
    unless `evaluate=True`. Before the first proposal, costs and errors are infinite.

    ## Arguments
    - `motion="walk"`: a kind of built-in motion, a list of kinds, or "all".
    - `held_out_people=True`: an instance shows one person's style of the motion, and a
      body whose bones and girths differ by up to 10 % from the average. Held-out
      instances show the styles of two people who occur neither in training instances
      nor in the prior's training motions. If false, everybody has the average body and
      the mean of all styles, in training and in the test; `motion` may then also be a
      single style, or an .amc or .bvh file.
    - `split="train"`: instances 0 to 9,999, or `"test"`: 10,000 to 19,999, which are
      held out. Numbers of the other split are refused.
    - `instance=None`: a number of the split; by default each reset draws one.
    - `yaw="guessed"`: the root's yaw is known to 20 degrees. "unknown": the person
      faces anywhere, and the first coordinate spans 180 degrees to either side
      of facing the first camera.
    - `view_degrees=45.0`: where the camera is, 0 in front of the person; a list for
      several views.
    - `prior="pca"`, `train=None`: the prior, and the motions from which it learns; by
      default other people's.
    - `translation="known"`: or "searched", around a guess up to 0.25 m off in each
      direction, or "aligned".
    - `size=(64, 48)`: width and height in pixels.
    - `noise=None`: corruptions of the silhouette and their strengths, such as
      `{"holes": 0.3, "shadow": 0.5}`; see `posefit.silhouette.corruption`.
    - `mismatch_percent=0.0`: the largest difference between the bones and radii of the
      fitted body and the person's.
    - `errors=True`: whether infos contain the truth in training. `evaluate=False`:
      whether they do in the test.
    - `max_evaluations=8`.

    ## Levels
    | id, after `posefit/` | arguments |
    |---|---|
    | FitImage-easy-v1 | `held_out_people=False` |
    | FitImage-v1 | by default |
    | FitImage-medium-v1 | `motion="all"` |
    | FitImage-hard-v1 | `motion="all"`, an unknown yaw, damaged silhouettes |

    ## Version History
    - v1: people are held out by default.
    - v0: `held_out_people=False`. Three of ten silhouettes of its test walks are in
      training, byte for byte.
    """

    def __init__(
        self,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        super().__init__(render_mode, arguments)
        self.max_evaluations = checked(whole, "max_evaluations", max_evaluations, 1)
        self.action_space, self.observation_space = image_spaces(self.world)
        self.stage = Stage(self.world, 1)
        self._cost = np.nan  # the last proposal's

    def begin(self, number: int) -> tuple[Image, Infos]:
        """Begin an episode with an instance: return its first observation and infos."""
        self.stage.set_scene(0, first_scene(self.world, number))
        frame = FirstFrame(self.world, number)
        self._problem = Problem(frame, self.stage.space(0), self.max_evaluations)
        picture = self.stage.pictures(self.stage.all_rows)[0]
        return picture, self._infos(infos_before(self.stage, self.world.shows_truth))

    def _infos(self, infos: Infos) -> Infos:
        """Return the infos of the only row, completed."""
        problem = self.problem
        infos = row_of(infos, 0)
        infos["best_cost"] = problem.best_cost
        infos["evaluations"] = problem.evaluations
        infos["remaining_steps"] = self.max_evaluations - problem.evaluations
        infos["instance"] = self.number
        if self.world.shows_truth:
            assert self.number is not None
            infos["truth"] = first_truth(self.world, self.number).copy()
        return infos

    def step(self, action: Any) -> tuple[Image, float, bool, bool, Infos]:
        """Evaluate a proposal. Raises ResetNeeded if the episode has ended."""
        proposal = self.checked_action(action)[None]
        problem = self.problem
        drawn = self.stage.draw(proposal, self.stage.all_rows)
        problem.count(proposal, drawn.costs)
        self._cost = float(drawn.costs[0])
        reward = float(reward_of_cost(self._cost))
        self.ended = not problem.remaining_evaluations
        infos = self._infos(proposal_infos(self.stage, drawn, self.world.shows_truth))
        return drawn.pictures[0], reward, self.ended, False, infos

    @property
    def space(self) -> SearchSpace:
        """The box of the episode's proposals."""
        self.check_reset()
        return self.stage.space(0)

    def picture(self) -> Picture:
        """Return the picture of the last proposal."""
        problem = self.problem
        label = _label(self.number, self._cost, problem.best_cost, problem.evaluations)
        return render_frame(problem.cost, self.stage.body(0), label)


class FitImageVectorEnv(SearchVectorEnv):
    """A vector of `num_envs` FitImageEnv environments."""

    row_attributes = ("instance", "number", "problem", "space")

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        **arguments: Any,
    ) -> None:
        super().__init__(num_envs, **arguments)
        self.max_evaluations = checked(whole, "max_evaluations", max_evaluations, 1)
        self.set_spaces(*image_spaces(self.world))
        self.stage = Stage(self.world, num_envs, self.threads)
        self._problems = Problems(num_envs, self.world.dimensions)
        self._costs = np.full(num_envs, np.nan)  # the last proposals'
        self._truths = np.zeros((num_envs, self.world.dimensions))

    def begin(self, rows: Rows) -> None:
        """Begin episodes in some environments, with the instances of `numbers`."""
        numbers = self.numbers[rows]
        for i, number in zip(rows.tolist(), numbers.tolist(), strict=True):
            self._problems.begin(i, partial(first_problem, self.world, number))
            if self.world.shows_truth:
                # the scene and the truth need the same instance, which does not stay
                # cached for long
                first_scene(self.world, number)
                self._truths[i] = first_truth(self.world, number)
        self.stage.set_scenes(rows, first_scenes(self.world, numbers))

    def observe(self, rows: Rows) -> Image:
        """Return the current pictures of some environments."""
        return self.stage.pictures(rows)

    def reset_infos(self) -> Infos:
        """Return the infos of a reset, by name."""
        return self._infos(infos_before(self.stage, self.world.shows_truth))

    def _infos(self, infos: Infos) -> Infos:
        """Return the infos of all rows, completed."""
        evaluations = self._problems.evaluations
        infos["best_cost"] = self._problems.best_costs.copy()
        infos["evaluations"] = evaluations.copy()
        infos["remaining_steps"] = self.max_evaluations - evaluations
        infos["instance"] = self.numbers.copy()
        if self.world.shows_truth:
            infos["truth"] = self._truths.copy()
        return infos

    def step(self, actions: Any) -> tuple[Image, Array, Flags, Flags, Infos]:
        """Evaluate a proposal in each environment; ended episodes reset."""
        proposals, stepping = self.begin_step(actions)
        rows = np.flatnonzero(stepping)
        problems = self._problems
        drawn = self.stage.draw(proposals, rows)
        problems.count(rows, proposals[rows, None], drawn.costs[rows, None])
        self._costs = drawn.costs
        rewards = reward_of_cost(drawn.costs)
        terminated = problems.evaluations >= self.max_evaluations
        infos = self._infos(proposal_infos(self.stage, drawn, self.world.shows_truth))
        return self.end_step(stepping, drawn.pictures, rewards, terminated, infos)

    def picture(self, i: int) -> Picture:
        """Return the picture of the last proposal in environment i."""
        problems = self.problems
        label = _label(
            int(self.numbers[i]),
            self._costs[i],
            problems.best_costs[i],
            problems.evaluations[i],
        )
        return render_frame(problems[i].cost, self.stage.body(i), label)


def _label(number: int | None, cost: float, best: float, evaluations: int) -> str:
    """Return the label below a picture."""
    if not evaluations:
        return f"instance {number}"
    return f"cost {cost:.1f}, best {best:.1f}, {evaluations} evaluations"
