"""One camera, two or four, at the same budget of evaluations: `python -m posefit_experiments.views`.

The first pose is searched several times, as it is for footage.
"""

import numpy as np

from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene
from posefit.tracking.method import Choice, prepare
from posefit.tracking.opening import RESTARTS, begun, following
from posefit.tracking.synthetic import followed, mean_error, measured, scene_of, task_of

VIEWS = ([90.0], [0.0, 90.0], [0.0, 45.0, 90.0, 135.0])
MOTIONS = ("walk", "walk-a", "run-a")
SEEDS = range(5)


def compare() -> None:
    """Print a row for every motion and number of cameras; translations are found from the silhouettes."""
    choice = Choice()
    for motion in MOTIONS:
        for views in VIEWS:
            scene = scene_of(motion, views)
            task = task_of(scene, choice, scene.body, translation="aligned")
            found = [measured(scene, _track(task, choice, scene, seed)) for seed in SEEDS]
            error, mpjpe, lost, swapped = (
                np.array([one[key] for one in found]) for key in ("error_degrees", "mpjpe_mm", "lost", "swapped")
            )
            print(
                f"{motion:8} {len(views)} views  error {np.median(error):5.2f} ({error.min():.2f} to "
                f"{error.max():.2f}) degrees, MPJPE {np.median(mpjpe):4.0f} mm, lost {100 * lost.mean():3.0f} %, "
                f"swapped {100 * swapped.mean():3.0f} %; mean pose {mean_error(scene, task):.2f} degrees",
                flush=True,
            )


def _track(task: Task, choice: Choice, scene: Scene, seed: int) -> list[Frame]:
    begin = begun(task, scene.observations, following(prepare(choice, task)), RESTARTS, seed)
    return followed(begin, choice, scene.observations, seed)


if __name__ == "__main__":
    compare()
