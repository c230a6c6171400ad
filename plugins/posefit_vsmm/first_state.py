"""The first state of a track, and the first one after the track was lost.

The patent does not say where the filter starts. Here a search of the silhouettes' cost
finds the first state: it tries typical poses of the models at several yaws, then
samples around the best so far. Each state is first moved to where it fits the
silhouettes.
"""

from dataclasses import dataclass

import numpy as np

from posefit.arrays import Array
from posefit.fitting.cost import align
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.silhouette.cost import pose_costs
from posefit_vsmm.motion import MotionModels
from posefit_vsmm.state import ERROR, DependentJoints, decode, encode, minus, plus

YAWS_NEAR = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])  # from an approximate yaw
YAWS_ALL_AROUND = np.linspace(-np.pi, np.pi, 12, endpoint=False)
TYPICAL_SHARE = 0.6  # of the budget: at most this for the typical poses
DRAWS = 40  # samples per round
# a quaternion this far from the typical pose adds 1 per cent to the cost
TYPICAL_DEVIATION = np.radians(15.0)
# one per round; later rounds use the last one
DRAW_DEVIATIONS = np.radians([20.0, 12.0, 7.0, 4.0])


@dataclass(frozen=True, eq=False)
class FirstState:
    """Estimates a state from a single frame."""

    task: Task
    models: MotionModels  # all models
    dependent: DependentJoints
    free: Array  # (33,) 1 for the errors that the joints allow, 0 for the others

    def estimate(
        self, observation: Observation, latest: Frame | None, rng: np.random.Generator
    ) -> tuple[Array, int]:
        """Return the state (43,) of least cost in a frame, and the evaluations used.

        `latest` is the track's latest frame; None before the first.
        """
        budget = self.task.evaluations - 1  # one is for the cost of the frame itself
        states = self._typical_states(latest, int(TYPICAL_SHARE * budget))
        costs, states = self._aligned_costs(observation, states)
        best = states[costs.argmin()]
        best_cost = float(costs.min())
        typical = best
        evaluations = len(states)
        for k in range((budget - evaluations) // DRAWS):
            deviation = DRAW_DEVIATIONS[min(k, len(DRAW_DEVIATIONS) - 1)]
            errors = self.free * rng.normal(0.0, deviation, (DRAWS, ERROR))
            errors[:, :3] = 0.0  # the alignment moves them
            costs, states = self._aligned_costs(observation, plus(best, errors))
            # Many poses have the same silhouette: of these, one near a typical pose is
            # more likely, and the models predict it better.
            turned = minus(states, typical)[:, 3:] / TYPICAL_DEVIATION  # (40, 30)
            costs += (turned**2).sum(axis=1)
            if costs.min() < best_cost:
                best = states[costs.argmin()]
                best_cost = float(costs.min())
            evaluations += DRAWS
        return best, evaluations

    def _typical_states(self, latest: Frame | None, most: int) -> Array:
        """Return typical states (n, 43) of the models, turned to several yaws.

        A known pose comes before them: the latest one of a lost track, or a given first
        pose. There are at most `most` states, but one typical one at least.
        """
        task = self.task
        yaw = task.yaw
        anchor = np.asarray(task.anchor)
        known_pose = None
        if latest is not None:
            yaw = float(latest.pose[0])
            anchor = latest.translation
            known_pose = latest.pose
        elif task.first_pose is not None:
            known_pose = np.concatenate([[yaw or 0.0, 0.0, 0.0], task.first_pose])
        yaws = YAWS_ALL_AROUND if yaw is None else yaw + YAWS_NEAR
        states = self.models.typical_states(yaws, anchor)
        count = min(len(states), most)
        if known_pose is not None:
            count -= 1
        count = max(1, count)
        # evenly over all models and yaws
        states = states[np.linspace(0, len(states) - 1, count).astype(np.int64)]
        if known_pose is None:
            return states
        return np.concatenate([encode(known_pose[None], anchor[None]), states])

    def _aligned_costs(
        self, observation: Observation, states: Array
    ) -> tuple[Array, Array]:
        """Return the costs (n,) of states (n, 43), and the states.

        Each state is first moved to where it fits the observation.
        """
        task = self.task
        known = observation.translation
        poses, places = decode(states, self.dependent)
        scene = task.body, task.cameras, observation.silhouettes
        if known is None:
            places = align(*scene, poses, places, task.threads)
        else:
            places[:] = known
        costs, _ = pose_costs(*scene, poses, places, threads=task.threads)
        return costs, np.column_stack([places, states[:, 3:]])
