"""Measures the errors of joint rules: `python docs/studies/make_joint_errors.py`.

Step 2, Interpretation V7. The rules see silhouettes of built-in motions from all sides,
with known truth, and expect every point near its true place. Left and right share their
errors, and no point is biased to one side. An error above OUTLIER means that another
point was taken. Such errors are counted, printed and left out.
"""

import json
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit_vsmm import joints
from posefit_vsmm.joints import BODY, GATE, default_rules, detect
from posefit_vsmm.measurement import head_radius
from posefit_vsmm.motion import leg_of
from posefit_vsmm.preprocess import lines_of
from posefit_vsmm.state import ENDS, POINTS

MOTIONS = ("walk-a", "walk-c", "march-a", "jacks-a", "squat-a", "jump-a", "run-a")
AZIMUTHS = np.radians([0.0, 20.0, -20.0, 45.0, -45.0, 90.0, -90.0, 180.0])
DISTANCE = 4.4  # metres
SIZE = (320, 240)
# legs: distance of the expected point from the truth, as after a good prediction
OFF = 0.05
OUTLIER = 0.16  # legs
# legs: standard deviation of points that only move with the root (Interpretation V8)
CIRCULAR = 0.25


def detection_errors(rng: np.random.Generator) -> dict[str, list[Array]]:
    """Return the errors (2,) in legs of the detections of each point."""
    unbiased = default_rules()._replace(bias=np.zeros((len(POINTS), 2)))
    errors_of: dict[str, list[Array]] = {name: [] for name in POINTS}
    for name, azimuth in product(MOTIONS, AZIMUTHS):
        motion = built_in.motion(name)
        body = Body.of(motion.skeleton)
        leg = leg_of(motion.skeleton)
        camera = Camera.around(
            np.array([0.0, 0.95, 0.0]), motion.poses[0, 0] + azimuth, DISTANCE, SIZE
        )
        scale = camera.focal[0] / DISTANCE
        for pose, place in zip(
            motion.poses[::2], motion.translations[::2] * [1.0, 1.0, 0.0], strict=True
        ):
            lines = lines_of(project(body, camera, pose, place))
            true, _ = camera.project(
                motion.skeleton.joints(pose, place)[ENDS].mean(axis=1)
            )
            expected = true + rng.normal(0.0, OFF * leg * scale, true.shape)
            assert lines is not None
            gates = np.full(len(POINTS), GATE[0] * leg * scale)
            points, confidence, _ = detect(
                lines, expected, gates, leg * scale, head_radius(body) * scale, unbiased
            )
            for k, point in enumerate(POINTS):
                if confidence[k] > 0.0:
                    errors_of[point].append((points[k] - true[k]) / (leg * scale))
    return errors_of


@click.command()
def main() -> None:
    """Write joints.json next to the rules."""
    errors_of = detection_errors(np.random.default_rng(0))
    frames = len(errors_of["root"])
    stored: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys(
        one.removeprefix("left ").removeprefix("right ") for one in POINTS
    ):
        sides = [one for one in POINTS if one.split()[-1] == name]
        errors = np.concatenate(
            [np.array(errors_of[one]).reshape(-1, 2) for one in sides]
        )
        middle = np.array([0.0, np.median(errors[:, 1])])
        kept = errors[np.linalg.norm(errors - middle, axis=1) < OUTLIER]
        bias = np.array([0.0, kept[:, 1].mean()])
        spread = np.sqrt(((kept - bias) ** 2).mean(axis=0))
        if sides[0] in BODY:
            bias = np.zeros(2)
            spread = np.full(2, CIRCULAR)
        seen = len(errors) / (frames * len(sides))
        outliers = 1 - len(kept) / len(errors)
        print(
            f"{name:10s} seen {seen:.2f} outliers {outliers:.2f} "
            f"bias {bias[1]:+.3f} deviation {spread[0]:.3f} {spread[1]:.3f} legs"
        )
        stored |= {
            one: {"bias": bias.round(4).tolist(), "deviation": spread.round(4).tolist()}
            for one in sides
        }
    text = json.dumps({"points": {name: stored[name] for name in POINTS}}, indent=1)
    Path(joints.__file__).with_name("joints.json").write_text(
        text + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
