"""Modes-v0: one silhouette that several poses explain, an episode of proposals and reports."""

from typing import Any

import numpy as np
from gymnasium import error, spaces

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.niching import LEVELS_MM, MIN_PROBABILITY, SIZE, NicheInstance, niche_instance, niche_space, scored
from posefit.silhouette.cost import project
from posefit.uncertainty.modes import Posterior
from posefit_envs.base import ENDED, NOT_BEGUN, ActionValidator, Infos
from posefit_envs.instance import ArgumentError, Image, backdrop, checked, instance_number, world_of
from posefit_envs.rendering import Picture, RenderedEnv, render_frame

MAX_EVALUATIONS = 2000
MAX_REPORTS = 10
BRIER_OF_NO_REPORT = 2.0  # as of one whose weight is all in the wrong place


class ModesEnv(RenderedEnv):
    """
    ## Description
    The observed silhouette is that of two or more known poses, exactly or nearly: the niching task of
    `posefit.niching`. The episode is a search for all of them, and for the probability of each. Each step proposes a
    pose, and may report it.

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
    An instance. Without `instance` each reset draws a number of the `split`; `reset(options={"instance": 17})` chooses
    one.

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
        self._world = world_of(instance=instance, split=split)
        if checked(whole, "max_reports", max_reports, 1) > MAX_REPORTS:
            raise ArgumentError(f"max_reports must be at most {MAX_REPORTS}, got {max_reports}")
        checked(whole, "max_evaluations", max_evaluations, 2)
        super().__init__(render_mode)
        numbers = niche_space().dimensions + 1
        self.action_space = spaces.Box(-1.0, 1.0, (numbers,), np.float32)
        self.observation_space = spaces.Box(0, 255, (SIZE[1], SIZE[0], 2), np.uint8)
        self._validator = ActionValidator(numbers)
        self._max_reports, self._budget = int(max_reports), int(max_evaluations)
        self._posed: NicheInstance | None = None

    @property
    def search_space(self) -> SearchSpace:
        """The space of proposals, an action without its last number."""
        return niche_space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Image, Infos]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        chosen = options.get("instance") if options else None
        number = self._world.next_instance(self.np_random) if chosen is None else instance_number(chosen)
        self._posed, self._ended = niche_instance(number), False
        self._cost, self._evaluations = np.inf, 0
        self._pose: Array | None = None
        self._reported: list[Array] = []  # poses
        self._weights: list[float] = []
        self._peak_ratio = np.zeros(len(LEVELS_MM))
        self._brier, self._log_score = BRIER_OF_NO_REPORT, -float(np.log(MIN_PROBABILITY))
        self._update_window()
        return self._picture(self._posed), {"instance": number}

    def step(self, action: Any) -> tuple[Image, float, bool, bool, Infos]:
        """Propose a pose, and report it where the last number is above 0."""
        posed = self._current()
        if self._ended:
            raise error.ResetNeeded(ENDED)
        action = self._validator.check(action, self.action_space.shape or ())
        before = np.mean(self._peak_ratio)
        poses, translations = posed.problem.decode(action[None, :-1])
        self._cost, self._pose = float(posed.problem.cost(poses, translations)[0]), poses[0]
        self._evaluations += 1
        if action[-1] > 0.0:
            self._reported.append(poses[0])
            self._weights.append(float(action[-1]))
            places = np.tile(posed.problem.space.anchor, (len(self._reported), 1))
            scores = scored(posed, Posterior(np.array(self._reported), places, np.array(self._weights)))
            self._peak_ratio = np.array([scores.peak_ratio[level] for level in LEVELS_MM])
            self._brier, self._log_score = scores.brier, scores.log_score
        reward = float(np.mean(self._peak_ratio) - before)
        terminated = len(self._weights) >= self._max_reports
        truncated = not terminated and self._evaluations >= self._budget
        self._ended = terminated or truncated
        info: Infos = {
            "cost": self._cost,
            "evaluations": self._evaluations,
            "reports": len(self._weights),
            "instance": posed.number,
        }
        if self._ended:
            reward -= self._brier
            info |= {"peak_ratio": self._peak_ratio, "brier": self._brier, "log_score": self._log_score}
        self._update_window()
        return self._picture(posed), reward, terminated, truncated, info

    def _current(self) -> NicheInstance:
        if self._posed is None:
            raise error.ResetNeeded(NOT_BEGUN)
        return self._posed

    def _picture(self, posed: NicheInstance) -> Image:
        """Return the picture (height, width, 2): the observed silhouette, and the last proposal."""
        problem = posed.problem
        picture = backdrop(problem.silhouettes).view(np.uint8)
        if self._pose is not None:
            picture[..., 1] = 255 * project(problem.body, problem.cameras[0], self._pose, problem.space.anchor)
        return picture

    def _render_frame(self) -> Picture:
        posed = self._current()
        label = f"instance {posed.number}, {posed.kind}"
        if self._pose is not None:
            label = f"cost {self._cost:.1f}, {len(self._weights)} reported, {self._evaluations} evaluations"
        return render_frame(posed.problem, self._pose, posed.problem.space.anchor, label)
