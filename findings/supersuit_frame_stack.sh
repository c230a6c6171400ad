#!/bin/sh
# SuperSuit 3.11.0: frame_stack_v2 of pictures along the first axis has no past, and all observations are one array.
#
# With `stack_dim=0`, grey pictures (H, W) are stacked as (4, H, W). The newest is written into the first three
# places, and the last stays 0: 7, 7, 7, 0 after the seventh step, where 4, 5, 6, 7 belong. Along the last axis the
# order is right. In all cases `reset` and `step` return the wrapper's own array, so that an observation that is kept
# changes with the next step: in `add(observation, action, following)` both are the same. Use gymnasium's
# FrameStackObservation, or stack along the last axis, move it, and copy.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
    SuperSuit==3.11.0 gymnasium==1.4.0 pettingzoo==1.27.0 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import gymnasium
import numpy as np
import supersuit

print("SuperSuit", version("SuperSuit"), "gymnasium", version("gymnasium"))


class Counting(gymnasium.Env):
    """Grey pictures that show the number of the step."""

    observation_space = gymnasium.spaces.Box(0, 255, (5, 6), np.uint8)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros((5, 6), np.uint8), {}

    def step(self, action):
        self.count += 1
        return np.full((5, 6), self.count, np.uint8), 0.0, False, False, {}


def after_seven(environment):
    """Return the seventh observation, and whether the sixth changed afterwards."""
    environment.reset(seed=0)
    for _ in range(6):
        sixth, *_ = environment.step(0)
    kept = np.array(sixth)
    seventh, *_ = environment.step(0)
    return np.array(seventh), not np.array_equal(sixth, kept)


first, first_changes = after_seven(supersuit.frame_stack_v2(Counting(), 4, stack_dim=0))
last, last_changes = after_seven(supersuit.frame_stack_v2(Counting(), 4, stack_dim=-1))
wrapper = gymnasium.wrappers.FrameStackObservation(Counting(), 4)
right, right_changes = after_seven(wrapper)
stacks = {
    "stack_dim=0": (first[:, 0, 0].tolist(), first_changes),
    "stack_dim=-1": (last[0, 0, :].tolist(), last_changes),
    "gymnasium": (right[:, 0, 0].tolist(), right_changes),
}
for name, (stack, changes) in stacks.items():
    print(f"{name}: {stack}; the observation before {'changed' if changes else 'stayed'}")
wanted = [([7, 7, 7, 0], True), ([4, 5, 6, 7], True), ([4, 5, 6, 7], False)]
raise SystemExit(list(stacks.values()) != wanted)
PYTHON
