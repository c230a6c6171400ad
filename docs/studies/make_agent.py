"""Draws the animation of a trained agent.

    python docs/studies/make_agent.py docs/pictures/agent.gif

Eight proposals for each of four silhouettes of the test split, whose people the agent
has never seen. Green is what both share, red the observed silhouette alone, blue the
proposed one alone.
"""

import sys
from typing import Any

import gymnasium as gym
import numpy as np
from PIL import Image

from posefit.arrays import Array
from posefit.output.drawing import LINES, blank, write
from posefit_envs import Corrections, trained_policy
from posefit_envs.fit import MAX_EVALUATIONS

NAME = "posefit_envs:posefit/FitImage-v1"
INSTANCES = (10_003, 10_021, 10_042, 10_064)
PART = slice(80, 240)  # the columns of a rendered picture that the person fills
TALL = 240
STRIP = 30  # pixels for the words below
COLOURS = 32
MILLISECONDS = 450
LAST_MILLISECONDS = 2000


def frame(pictures: Any, costs: Array | None) -> Any:
    """Return a picture of all silhouettes side by side, with their costs below."""
    columns = []
    for number, picture in enumerate(pictures):
        overlap = np.asarray(picture)[:TALL, PART]
        words = blank(STRIP, overlap.shape[1])
        label = "a silhouette" if costs is None else f"cost {costs[number]:.1f}"
        write(words, label, (8, 20), scale=0.5)
        columns.append(np.vstack([overlap, words[..., ::-1]]))
        columns.append(np.full((TALL + STRIP, 4, 3), LINES, np.uint8))
    return Image.fromarray(np.hstack(columns[:-1]))


def main(out: str) -> None:
    """Let the agent propose, and draw the animation."""
    vector = gym.make_vec(NAME, len(INSTANCES), split="test", render_mode="rgb_array")
    env = Corrections(vector)
    policy = trained_policy("fit-image")
    observations, _ = env.reset(options={"instance": list(INSTANCES)})
    frames = [frame(env.render(), None)]
    for step in range(MAX_EVALUATIONS):
        actions = np.clip(policy(observations, step), -1.0, 1.0)
        observations, _, _, _, infos = env.step(actions)
        frames.append(frame(env.render(), infos["cost"]))
    # a palette of the last picture has every colour
    palette = frames[-1].quantize(COLOURS, dither=Image.Dither.NONE)
    drawn = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in frames]
    seconds = [2 * MILLISECONDS, *[MILLISECONDS] * (MAX_EVALUATIONS - 1)]
    drawn[0].save(
        out,
        save_all=True,
        append_images=drawn[1:],
        duration=[*seconds, LAST_MILLISECONDS],
        loop=0,
        optimize=True,
    )


if __name__ == "__main__":
    main(sys.argv[1])
