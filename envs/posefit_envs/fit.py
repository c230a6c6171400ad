"""Fit-v0: one silhouette, an episode of proposals."""

from typing import Any, Unpack

import numpy as np
from gymnasium import error, spaces

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import finite_number, whole
from posefit_envs.base import SearchEnv
from posefit_envs.drawing import Picture, portray
from posefit_envs.instance import Arguments, Instance, World, approved, instance, select
from posefit_envs.search import Image
from posefit_envs.stage import Evaluated, Stage

MAX_EVALUATIONS = 200
TARGET_COST = 2.0


class FitEnv(SearchEnv["Episode"]):
    """
    ## Description
    A person was seen as a silhouette. Each step proposes a pose; its body is projected, and what does not overlap with
    the silhouette is its cost. The episode is a search for the pose, the hard way: by proposals alone.

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, with `prior="pca"` and a known translation d = 9.

    | Num | Meaning | Min and max stand for |
    |---|---|---|
    | 0, 1, 2 | root yaw, pitch, roll | 45, 15, 15 degrees to either side of a guess |
    | 3, 4, 5 | root translation, with `translation="searched"` only | 0.5 m to either side |
    | the rest | latents of the prior | the range of its training poses |

    Actions outside are clipped, with one warning. float64 is taken as it is, and not rounded.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, for each view:

    | Channel | Meaning |
    |---|---|
    | 0 | the observed silhouette: 255 is the person |
    | 1 | the silhouette of the last proposal; empty before the first |

    ## Rewards
    Minus the cost of the proposal, 0 to 100; SAPSO (4).

    ## Starting State
    An instance: a pose of the motion, its cadence, and the middle of the searched yaw, all from its number. Without
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
    - `noise=None`: what is wrong with the silhouette, such as `{"holes": 0.3, "shadow": 0.5}`; see
      `posefit.silhouette.corruption`.
    - `mismatch_percent=0.0`: how far bones and radii of the fitted body are off at most.
    - `errors=True`: whether infos hold errors against the truth; a learner that does not read them may do without.
    - `target_cost=2.0`, `max_evaluations=200`.

    ## Version History
    - v0: first version. Before its release its instances changed: number n is now the motion, speed, phase and view of
      a sweep's instance n, and 0 the motion as it is. Results from before cannot be compared with later ones.
      `errors` came later, before its release as well, and changes nothing by default.
    """

    def __init__(
        self,
        *,
        target_cost: float = TARGET_COST,
        max_evaluations: int = MAX_EVALUATIONS,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_budget(target_cost, "max_evaluations", max_evaluations)
        selection = select(**arguments)
        super().__init__(selection, spaces_of(selection.world), render_mode)
        self._target, self._most = float(target_cost), int(max_evaluations)
        self._stage = Stage(self.world, 1)

    @property
    def search_space(self) -> SearchSpace:
        """The space of the current instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Image, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        episode = self._search = Episode(self.world, number, self._most)
        self._stage.put(0, episode.scenery, episode.space)
        self._show()
        return episode.scenery.picture, {"instance": number}

    def step(self, action: Any) -> tuple[Image, float, bool, bool, dict[str, Any]]:
        """Propose a pose."""
        episode = self._current()
        if episode.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._door.proposals(action, self._shape)
        outcome = self._stage.look(proposal[None], self._stage.everyone)
        info = episode.take(outcome, self._selection.errors)
        terminated = episode.best_cost <= self._target
        truncated = not terminated and episode.evaluations >= self._most
        episode.ended = terminated or truncated
        self._show()
        return outcome.pictures[0], -info["cost"], terminated, truncated, info

    def _portrait(self, search: "Episode") -> Picture:
        return portray(search.scenery, search.pose, search.translation, search.label)


class Episode:
    """The state of one search."""

    def __init__(self, world: World, number: int, evaluations: int) -> None:
        self.instance: Instance = instance(world, number, 1, evaluations)
        self.space = self.instance.space(world.learned)
        self.scenery = self.instance.scenery(0)
        self.best_cost, self.evaluations, self.ended = np.inf, 0, False
        self.cost = np.inf
        self.pose: Array | None = None
        self.translation: Array | None = None

    def take(self, outcome: Evaluated, errors: bool) -> dict[str, Any]:
        """Remember a proposal's outcome and return its information, with `errors` against the truth or without."""
        self.cost = float(outcome.costs[0])
        self.best_cost = min(self.best_cost, self.cost)
        self.evaluations += 1
        self.pose, self.translation = outcome.poses[0], outcome.translations[0]
        info = {
            "cost": self.cost,
            "best_cost": self.best_cost,
            "evaluations": self.evaluations,
            "areas": outcome.areas[0],
            "instance": self.instance.number,
        }
        return info | self.instance.errors(0, self.pose) if errors else info

    @property
    def label(self) -> str:
        """What is written into the picture."""
        if self.pose is None:
            return f"instance {self.instance.number}"
        return f"cost {self.cost:.1f}, best {self.best_cost:.1f}, {self.evaluations} evaluations"


def action_shape(setting: World) -> tuple[int]:
    """Return (d,) of a world's proposals."""
    return (len(setting.learned.low) + (6 if setting.translation == "searched" else 3),)


def spaces_of(setting: World) -> tuple[spaces.Box, spaces.Box]:
    """Return the action space and the observation space of a world."""
    width, height = setting.size
    return (
        spaces.Box(-1.0, 1.0, action_shape(setting), np.float32),
        spaces.Box(0, 255, (height, width, 2 * len(setting.view_degrees)), np.uint8),
    )


def check_budget(target_cost: float, name: str, evaluations: int) -> None:
    """Return nothing. Raises ArgumentError where a number makes no sense."""
    approved(finite_number, "target_cost", target_cost)
    approved(whole, name, evaluations, 2)
