"""Makes a data set of demonstrations in FitImage-v1, in the form of Minari.

    python docs/studies/make_demonstrations.py --episodes 1000

An episode has a training instance and eight proposals, each nearer to the truth than
the one before: a picture of a proposal comes with what to propose next. Minari keeps
the data set under its name below its own folder, MINARI_DATASETS_PATH.
"""

from typing import Any

import click
import gymnasium as gym
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import Command, progress
from posefit.motion.instances import TRAINING

NAME = "posefit/fit-image/narrowing-v0"
ENVIRONMENT = "posefit_envs:posefit/FitImage-v1"
SPREAD = 0.5  # standard deviation of the first proposal around the truth
NARROWING = 0.6  # factor on it from proposal to proposal
SCORED = 100  # episodes of which the scores of reference are the means


def episode(
    env: gym.Env[Any, Any], instance: int, rng: np.random.Generator, spread: float
) -> dict[str, Any]:
    """Return the steps of an episode whose proposals narrow to the truth.

    Args:
        env: The environment.
        instance: The instance's number.
        rng: Draws the proposals.
        spread: The standard deviation of the first proposal, 0 for the truth itself, or
            inf for proposals anywhere in the box.

    Returns:
        The observations (k + 1), actions, rewards, terminations and truncations (k).
    """
    observation, info = env.reset(options={"instance": instance})
    truth = info["truth"]
    observations = [observation]
    actions = list[Array]()
    rewards = list[float]()
    ends = list[tuple[bool, bool]]()
    while not ends or not any(ends[-1]):
        if np.isinf(spread):
            proposal = rng.uniform(-1.0, 1.0, truth.shape)
        else:
            width = spread * NARROWING ** len(actions)
            proposal = rng.normal(truth, width)
        action = np.clip(proposal, -1.0, 1.0).astype(np.float32)
        observation, reward, terminated, truncated, _ = env.step(action)
        observations.append(observation)
        actions.append(action)
        rewards.append(float(reward))
        ends.append((terminated, truncated))
    terminations, truncations = zip(*ends, strict=True)
    return {
        "observations": np.array(observations),
        "actions": np.array(actions),
        "rewards": np.array(rewards),
        "terminations": np.array(terminations),
        "truncations": np.array(truncations),
    }


@click.command(cls=Command)
@click.option("--episodes", default=1000, show_default=True, type=click.IntRange(min=1))
@click.option("--seed", default=0, show_default=True)
def main(episodes: int, seed: int) -> None:
    """Write the data set, which Minari then loads by its name.

    Raises:
        ValueError: Minari has a data set of this name already.
    """
    # the extra for what it writes: pip install 'minari[hdf5]'
    import minari
    from minari.data_collector.episode_buffer import EpisodeBuffer

    env = gym.make(ENVIRONMENT)
    rng = np.random.default_rng(seed)
    instances = rng.choice(TRAINING[-1] + 1, size=episodes, replace=episodes > 10_000)

    def mean_return(spread: float) -> float:
        returns = [
            episode(env, instance, rng, spread)["rewards"].sum()
            for instance in range(SCORED)
        ]
        return float(np.mean(returns))

    worst = mean_return(np.inf)
    best = mean_return(0.0)
    buffers = []
    for number, instance in enumerate(
        progress(instances.tolist(), episodes, "episode")
    ):
        steps = episode(env, instance, rng, SPREAD)
        options = {"instance": instance}
        buffers.append(EpisodeBuffer(id=number, options=options, **steps))
    minari.create_dataset_from_buffers(
        NAME,
        buffers,
        env=env,
        algorithm_name=f"truth with noise of {SPREAD} x {NARROWING}^k",
        author="The posefit developers",
        requirements=["posefit"],
        description=(
            "Find the pose of a person whose silhouette is given. Each of the eight "
            "proposals of an episode is nearer to the true pose than the one before. "
            "An observation has the given silhouette, and that of the last proposal."
        ),
        ref_min_score=worst,
        ref_max_score=best,
        # masks have two channels, and JPEG would blur them
        jpeg_encoding=False,
    )
    print(f"{NAME}: {episodes} episodes, returns {worst:.2f} random, {best:.2f} truth")


if __name__ == "__main__":
    main()
