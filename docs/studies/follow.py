"""The cost of tracking with the library: time per frame, memory, a fit's step.

    python docs/studies/follow.py 2000

The argument is the number of frames. It prints the CPU milliseconds of a frame on one
thread, the process's peak memory in megabytes, and how many pose costs take as long as
a step of a contour fit.
"""

import resource
from collections.abc import Iterator
from dataclasses import replace
from time import process_time
from timeit import repeat

import click
import numpy as np
from threadpoolctl import threadpool_limits

from clips import EVALUATIONS
from posefit.cli.output import Command
from posefit.fitting.contours import fitted, precisions
from posefit.fitting.tracker import Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.motion import recorded
from posefit.registry import registry
from posefit.tracking.initialise import task_of
from posefit.tracking.options import TrackOptions
from posefit_exemplars.cost_model import TURN_SPREAD
from posefit_exemplars.fits import CONTINUED_REACHES, KNOWN_SHIFT
from posefit_exemplars.frame_costs import FrameCosts

# 27 seconds, which are played forwards and backwards as often as needed
CLIP = "14_13"
POSES = 40  # in a call that measures the effort of a step


def follow_figures(frames: int) -> dict[str, float]:
    """Return the cost of tracking `frames` frames on one thread.

    The library is without the clip's subject. `ms` is the CPU time of a frame, and `mb`
    the process's peak memory. `step_poses` is the number of pose costs that take as
    long as a step of a fit.
    """
    training = [
        clip.motion() for clip in recorded.clips(without=[recorded.clip(CLIP).subject])
    ]
    scene = synthetic(
        recorded.clip(CLIP).motion(), (45.0,), (320, 240), [], (None, None)
    )
    task = replace(
        task_of(
            scene,
            TrackOptions(translation="aligned", evaluations=EVALUATIONS),
            training,
        ),
        yaw=None,
    )

    def observations(count: int) -> Iterator[Observation]:
        last = scene.count - 1
        for k in range(count):
            yield scene.observations[last - abs(k % (2 * last) - last)]

    with threadpool_limits(1):
        tracker = registry().offer("tracker", "exemplars").factory(task)
        # loads compiled code
        list(tracker.track(observations(2), np.random.default_rng(0)))
        began = process_time()
        for _ in tracker.track(observations(frames), np.random.default_rng(0)):
            pass
        seconds = process_time() - began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
        return {
            "ms": 1e3 * seconds / frames,
            "mb": peak,
            "step_poses": _step_poses(task, scene),
        }


def _step_poses(task: Task, scene: Scene) -> float:
    truth = scene.truth
    assert truth is not None
    poses, places = (
        np.repeat(array[:1], POSES, axis=0)
        for array in (truth.poses, truth.translations)
    )
    poses += (
        np.random.default_rng(0).normal(0.0, 0.1, poses.shape) * truth.skeleton.free
    )
    frame_costs = FrameCosts(task, scene.observations[0])
    contours = frame_costs.contours(places[0])
    weights = precisions(TURN_SPREAD, KNOWN_SHIFT)
    jobs = (
        lambda: fitted(
            task.body, contours, (poses, places), poses, weights, CONTINUED_REACHES
        ),
        lambda: frame_costs.full(poses, places),
    )
    fit, cost = (
        min(repeat(job, number=1, repeat=20, timer=process_time)) for job in jobs
    )
    return fit / len(CONTINUED_REACHES) / cost


@click.command(cls=Command, help=__doc__)
@click.argument("frames", type=click.IntRange(1))
def main(frames: int) -> None:
    """Print the figures. A thousand frames take one or two minutes."""
    for name, value in follow_figures(frames).items():
        click.echo(f"{name:12} {round(value, 3):,g}")


if __name__ == "__main__":
    main()
