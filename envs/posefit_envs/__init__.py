"""Gymnasium environments of posefit: `gym.make("posefit_envs:posefit/FitImage-v1")`.

    import gymnasium as gym

    env = gym.make("posefit_envs:posefit/FitImage-v1", motion="run", instance=17)
    observation, info = env.reset(seed=0)
    action = env.action_space.sample()
    observation, reward, terminated, truncated, info = env.step(action)

In `FitImage-v1` an agent has a few proposals to find the pose in one silhouette. In
`Track-v1` it follows a sequence of silhouettes. In `Race-v1` several searches share a
budget, and each action chooses which one continues. Their docstrings are their manual.

Importing this package registers the environments; each module is imported when its
environment is made. `drive` runs an optimiser against an environment or a vector of
them, and `drive_each` one in every environment of a vector. `track_reference` returns
what a tracker would commit in Track-v1. `Corrections` makes FitImage-v1 easier to
learn, `trained_policy` returns a policy that has learned it, and `to_sb3_vec_env`
adapts a vector environment to Stable-Baselines3.

A step rasterises proposals in the scenes of a `Stage`. It counts them in a
`posefit.Problem`, or in `posefit.Problems` for a vector. Each environment's file has a
single class and a vector class, which share their functions.

| looking for | file |
|---|---|
| FitImage-v1, Track-v1, Race-v1: from action to reward | fit.py, track.py, race.py |
| what they share: actions, rewards, infos, start and end of episodes | base.py |
| arguments, and the scene of an instance (see `posefit.motion.instances`) | world.py |
| poses, costs and pictures in many scenes at once; compiled | stage.py, kernels.py |
| rendering | rendering.py |
| single environments and vectors in any autoreset mode, row by row | rows.py |
| optimisers that search an environment | driving.py |
| what learners see; policies, some of them trained | corrections.py, policies.py |
| Stable-Baselines3 | sb3.py |
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from posefit_envs.corrections import Corrections as Corrections
    from posefit_envs.driving import drive as drive
    from posefit_envs.driving import drive_each as drive_each
    from posefit_envs.driving import track_reference as track_reference
    from posefit_envs.policies import trained_policy as trained_policy
    from posefit_envs.sb3 import to_sb3_vec_env as to_sb3_vec_env

_MODULES = {
    "Corrections": "corrections",
    "drive": "driving",
    "drive_each": "driving",
    "track_reference": "driving",
    "trained_policy": "policies",
    "to_sb3_vec_env": "sb3",
}
__all__ = list(_MODULES)

_KNOWN_PEOPLE = {"held_out_people": False}
# v0 shows the same people in training and in the test
_IDS: dict[str, dict[str, Any]] = {
    "FitImage-v0": _KNOWN_PEOPLE,
    "FitImage-v1": {},
    "FitImage-easy-v1": _KNOWN_PEOPLE,
    "FitImage-medium-v1": {"motion": "all"},
    "FitImage-hard-v1": {
        "motion": "all",
        "yaw": "unknown",
        "noise": {"holes": 0.3, "shadow": 0.5},
    },
    "Track-v0": _KNOWN_PEOPLE,
    "Track-v1": {},
    "Race-v0": _KNOWN_PEOPLE,
    "Race-v1": {},
}
_FILES = {"FitImage": "fit", "Track": "track", "Race": "race"}

for _id, _arguments in _IDS.items():
    _class = _id.partition("-")[0]
    register(
        id=f"posefit/{_id}",
        entry_point=f"posefit_envs.{_FILES[_class]}:{_class}Env",
        vector_entry_point=f"posefit_envs.{_FILES[_class]}:{_class}VectorEnv",
        kwargs=_arguments,
    )


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'posefit_envs' has no attribute {name!r}")
    value = getattr(import_module(f"posefit_envs.{_MODULES[name]}"), name)
    globals()[name] = value
    return value
