"""Gymnasium environments of posefit: `gym.make("posefit_envs:posefit/Fit-v1")`.

    import gymnasium as gym

    env = gym.make("posefit_envs:posefit/Fit-v1", motion="run", instance=17)
    observation, info = env.reset(seed=0)
    observation, gain, ended, cut, info = env.step(env.action_space.sample())

`Fit-v1` is a search for the pose in one silhouette, `Fit-v0` one whose observation is the picture; `Track-v0` follows a
sequence; `Configure-v1` chooses and steers the optimisers of a search, `Configure-v0` a swarm; `Modes-v0` asks for all
poses of one silhouette. Their docstrings are their manual. Importing this package registers them; the environments
themselves are imported when they are made. `drive` runs an optimiser against an environment or a vector of them,
`drive_each` one in every environment of a vector, `track_reference` says what a tracker would commit in Track-v0,
`to_sb3_vec_env` hands a vector environment to Stable-Baselines3, and `check_vector_env` compares any vector environment
with single ones. `posefit_envs.policies` has references to beat.

| looking for | file |
|---|---|
| Fit-v0, Track-v0 | fit.py, track.py |
| Fit-v1 | proposing/ |
| Modes-v0: niching | modes.py |
| Configure-v0: dynamic algorithm configuration | configure.py |
| Configure-v1: with a choice of optimisers | configuring/ |
| all but Modes-v0 many at once, their seeds and masks, a checker of them; Stable-Baselines3 | vector/ |
| references as policies | policies.py |
| the arguments; what an instance's number stands for (as in sweeps: `posefit.footage.instance`) | instance.py |
| what is seen in a frame; actions that are not allowed | search.py |
| what single environments share: their arguments, the door for actions, the window | base.py |
| proposals become poses, costs and pictures, in many scenes at once; compiled | stage.py, kernels.py |
| what is rendered | drawing.py |
| optimisers that search an environment, trackers as references | driving.py, searched/ |
| what numbers of actions stand for, how a cost shows, what its fall earns | scales.py |
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from posefit_envs.driving import drive as drive
    from posefit_envs.driving import drive_each as drive_each
    from posefit_envs.driving import track_reference as track_reference
    from posefit_envs.vector.checker import check_vector_env as check_vector_env
    from posefit_envs.vector.sb3 import to_sb3_vec_env as to_sb3_vec_env

_HOME = {
    "check_vector_env": "vector.checker",
    "drive": "driving",
    "drive_each": "driving",
    "track_reference": "driving",
    "to_sb3_vec_env": "vector.sb3",
}
__all__ = list(_HOME)

register(
    id="posefit/Fit-v0",
    entry_point="posefit_envs.fit:FitEnv",
    vector_entry_point="posefit_envs.vector.fit:FitVectorEnv",
)
register(
    id="posefit/Fit-v1",
    entry_point="posefit_envs.proposing.single:ProposalEnv",
    vector_entry_point="posefit_envs.vector.proposing:ProposalVectorEnv",
)
register(
    id="posefit/Track-v0",
    entry_point="posefit_envs.track:TrackEnv",
    vector_entry_point="posefit_envs.vector.track:TrackVectorEnv",
)
register(
    id="posefit/Configure-v0",
    entry_point="posefit_envs.configure:ConfigureEnv",
    vector_entry_point="posefit_envs.vector.configure:ConfigureVectorEnv",
)
register(
    id="posefit/Configure-v1",
    entry_point="posefit_envs.configuring.single:OptimiserEnv",
    vector_entry_point="posefit_envs.vector.configuring:OptimiserVectorEnv",
)
register(id="posefit/Modes-v0", entry_point="posefit_envs.modes:ModesEnv")


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'posefit_envs' has no attribute {name!r}")
    value = getattr(import_module(f"posefit_envs.{_HOME[name]}"), name)
    globals()[name] = value
    return value
