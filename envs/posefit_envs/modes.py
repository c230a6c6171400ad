"""Modes-v0: one silhouette that several poses explain, an episode of proposals and reports."""

from typing import Any

import numpy as np
from gymnasium import error, spaces

from posefit import Observation, SearchSpace, Task
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.niching import LEVELS_MM, MIN_PROBABILITY, SIZE, niche_instance, niche_space, scored
from posefit.silhouette.cost import project
from posefit.uncertainty.modes import Posterior
from posefit_envs.base import ActionValidator, RenderedEnv
from posefit_envs.instance import (
    SPLITS,
    ArgumentError,
    Image,
    Scenery,
    Selection,
    World,
    checked,
    instance_number,
)
from posefit_envs.rendering import Picture, render_frame

MAX_EVALUATIONS = 2000
MAX_REPORTS = 10
BRIER_OF_NO_REPORT = 2.0  # as of one whose weight is all in the wrong place


class ModesEnv(RenderedEnv):
    """
    ## Description
    The observed silhouette is that of two or more known poses, exactly or nearly: a stride and the one half a cycle
    later, a person who comes and one who goes, an arm before the trunk or behind it. The episode is a search for all of
    them, and for the probability of each. Each step proposes a pose, and may report it.

    ## Action Space
    `Box(-1, 1, (9,), float32)`:

    | Num | Meaning | Min and max stand for |
    |---|---|---|
    | 0 | root yaw | all round |
    | 1, 2 | root pitch, roll | 8 degrees to either side |
    | 3, 4, 5 | legs and trunk | the range of recorded walks and runs |
    | 6, 7 | arms | the range of all recorded motions |
    | 8 | the report: above 0, the pose is reported, with this weight among all that are reported | |

    Actions outside are clipped, with one warning. float64 is not rounded.

    ## Observation Space
    `Box(0, 255, (96, 128, 2), uint8)`:

    | Channel | Meaning |
    |---|---|
    | 0 | the observed silhouette: 255 is the person |
    | 1 | the silhouette of the last proposal; empty before the first |

    ## Rewards
    The increase of the peak ratio by a report: the share of the known poses that are matched, the mean of the levels
    15, 30 and 60 mm. With the last step, minus the Brier score of all reports: 0 where all the weight is near the pose
    whose silhouette it is, 2 where none is or nothing was reported.

    ## Starting State
    An instance of the niching task, see `posefit.niching`. Without `instance` each reset draws a number of the `split`;
    `reset(options={"instance": 17})` chooses one.

    ## Episode End
    Terminates when `max_reports` poses are reported; truncated after `max_evaluations` proposals.

    ## Information
    `cost` of the proposal, 0 to 100, `evaluations`, `reports`, `instance`; with the last step `peak_ratio` (3,) at the
    three levels, `brier` and `log_score`. A reset gives `instance` alone.

    ## Arguments
    - `instance=None`: 0 to 19,999. `split="train"` draws of 0 to 9,999, `"test"` of the others, which are held out.
    - `max_reports=10`: 1 to 10, `max_evaluations=2000`.
    """

    def __init__(
        self,
        *,
        instance: int | None = None,
        split: str = "train",
        max_reports: int = MAX_REPORTS,
        max_evaluations: int = MAX_EVALUATIONS,
        render_mode: str | None = None,
    ) -> None:
        if split not in SPLITS:
            raise ArgumentError(f"split must be one of {', '.join(SPLITS)}, got {split!r}")
        if checked(whole, "max_reports", max_reports, 1) > MAX_REPORTS:
            raise ArgumentError(f"max_reports must be at most {MAX_REPORTS}, got {max_reports}")
        checked(whole, "max_evaluations", max_evaluations, 2)
        number = None if instance is None else instance_number(instance)
        actions = spaces.Box(-1.0, 1.0, (niche_space().dimensions + 1,), np.float32)
        pictures = spaces.Box(0, 255, (SIZE[1], SIZE[0], 2), np.uint8)
        super().__init__(render_mode)
        self.action_space, self.observation_space = actions, pictures
        self._selection = Selection(World(), number, split, errors=True)
        self._validator = ActionValidator(niche_space().dimensions + 1)
        self._episode: ModesEpisode | None = None
        self._reports, self._budget = int(max_reports), int(max_evaluations)

    @property
    def search_space(self) -> SearchSpace:
        """The space of proposals, an action without its last number."""
        return niche_space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Image, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        episode = self._episode = ModesEpisode(number)
        self._update_window()
        return episode.scenery.picture, {"instance": number}

    def step(self, action: Any) -> tuple[Image, float, bool, bool, dict[str, Any]]:
        """Propose a pose, and report it where the last number is above 0."""
        episode = self._current()
        if episode.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._validator.check(action, self.action_space.shape or ())
        before = episode.peak_ratio
        episode.propose(proposal[:-1], float(proposal[-1]))
        reward = float(np.mean(episode.peak_ratio) - np.mean(before))
        terminated = len(episode.weights) >= self._reports
        truncated = not terminated and episode.evaluations >= self._budget
        episode.ended = terminated or truncated
        info: dict[str, Any] = {
            "cost": episode.cost,
            "evaluations": episode.evaluations,
            "reports": len(episode.weights),
            "instance": episode.posed.number,
        }
        if episode.ended:
            reward -= episode.brier
            info |= {"peak_ratio": episode.peak_ratio, "brier": episode.brier, "log_score": episode.log_score}
        self._update_window()
        return episode.picture, reward, terminated, truncated, info

    def _current(self) -> "ModesEpisode":
        if self._episode is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._episode

    def _render_frame(self) -> Picture:
        episode = self._current()
        return render_frame(episode.scenery, episode.pose, episode.posed.problem.space.anchor, episode.label)


class ModesEpisode:
    """The state of one search for several poses."""

    def __init__(self, number: int) -> None:
        self.posed = niche_instance(number)
        problem = self.posed.problem
        self.scenery = Scenery(
            Task(problem.body, problem.cameras, MAX_EVALUATIONS, None, problem.space.anchor.copy()),
            Observation(problem.silhouettes, problem.space.anchor.copy()),
        )
        self.cost, self.evaluations, self.ended = np.inf, 0, False
        self.pose: Array | None = None
        self.weights: list[float] = []
        self._poses: list[Array] = []
        self.peak_ratio, self.brier, self.log_score = (
            np.zeros(len(LEVELS_MM)),
            BRIER_OF_NO_REPORT,
            -float(np.log(MIN_PROBABILITY)),
        )

    def propose(self, proposal: Array, weight: float) -> None:
        """Evaluate a proposal (d,), and report it where its weight is above 0."""
        problem = self.posed.problem
        poses, translations = problem.decode(proposal[None])
        self.cost, self.pose = float(problem.cost(poses, translations)[0]), poses[0]
        self.evaluations += 1
        if weight > 0.0:
            self._poses.append(poses[0])
            self.weights.append(weight)
            places = np.tile(problem.space.anchor, (len(self._poses), 1))
            scores = scored(self.posed, Posterior(np.array(self._poses), places, np.array(self.weights)))
            self.peak_ratio = np.array([scores.peak_ratio[level] for level in LEVELS_MM])
            self.brier, self.log_score = scores.brier, scores.log_score

    @property
    def picture(self) -> Image:
        """The picture (height, width, 2): the observed silhouette, and the last proposal."""
        picture = self.scenery.picture
        if self.pose is not None:
            problem = self.posed.problem
            picture[..., 1] = 255 * project(problem.body, problem.cameras[0], self.pose, problem.space.anchor)
        return picture

    @property
    def label(self) -> str:
        """What is written into the picture."""
        if self.pose is None:
            return f"instance {self.posed.number}, {self.posed.kind}"
        return f"cost {self.cost:.1f}, {len(self.weights)} reported, {self.evaluations} evaluations"
