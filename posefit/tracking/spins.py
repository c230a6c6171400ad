"""A body that spins is tracked again, except for the longest run without spins.

A silhouette hardly distinguishes a body that faces the camera from its reflection,
which faces away. A track that confuses the two for a while spins when it changes over,
and when it changes back. Each of its frames then votes for one of the two.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Follow, Frame, Observation, Task
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.symmetry import facing
from posefit.motion.steadiness import runs
from posefit.tracking.restarts import after, joined, reversed_task, stream
from posefit.tracking.trajectory import (
    Tracked,
    cheapest_sequence,
    mean_cost,
    with_total_effort,
)

# If removing the spins raises the cost of the track by this factor or more, the new
# track is wrong: the person really turns that fast.
SPIN_TOLERANCE = 1.5
# Radians a second: the fastest turn of a person on the spot.
MAX_TURN_RATE = np.radians(450.0)
SPIN_SECONDS = 0.1
# A turn by more than this within SPIN_SECONDS is a spin, even in a smoothed track.
SPIN_ANGLE = np.radians(60.0)
END_SECONDS = 0.5  # the run without spins is cut at most this far from its ends
VOTES_PER_SECOND = 30.0
# The penalty on a turn faster than a person's, in votes for each radian in excess.
EXCESS_TURN_VOTES = 30.0


def retrack_spins(
    task: Task,
    observations: Sequence[Observation],
    tracked: Tracked,
    follow: Follow,
    seed: int,
) -> Tracked:
    """Return a track without spins.

    Only the longest run of frames that face as most frames do is kept, between its best
    ends; see `facing_consensus`. The person is followed onward from its last frame, and
    backwards from its first frame with reversed training motions. The old track is kept
    if the new one spins as often, or costs half as much again. Frames that are tracked
    again get the effort of both tracks.

    Args:
        task: The task of the track.
        observations: All frames.
        tracked: The track.
        follow: The tracker.
        seed: The seed of the random numbers.

    Returns:
        The track. Its `kept_run` has the first and the last frame that were kept, or
        None if all were.
    """
    frames = tracked.frames
    usable = np.array([observation.usable for observation in observations])

    def spins(track: Sequence[Frame]) -> int:
        """Return in how many frames a track spins."""
        yaws = np.array([frame.pose[0] for frame in track])
        return int(spin_mask(yaws, usable, task.fps).sum())

    before = spins(frames)
    if not before:
        return tracked
    steady_runs = runs(facing_consensus(frames, task.cameras, usable, task.fps))
    if not steady_runs:
        return tracked
    longest = max(steady_runs, key=lambda run: run[1] - run[0])
    kept_run = best_ends(frames, *longest, task.fps)
    first, last = kept_run
    # without this limit the tracker would find the same spins again
    steady = replace(task, fastest_turn=MAX_TURN_RATE)

    def followed_from(number: int, steady: Task, rows: range) -> list[Frame]:
        """Return the frames of all rows but the first, followed from the first."""
        if len(rows) == 1:
            return []
        start = replace(after(steady, frames[rows[0]]), before=())
        shown = (observations[k] for k in rows)
        again = list(follow(start, shown, stream(seed, "spin", number)))
        return joined(task.body.skeleton, again, frames[rows[0]])[1:]

    ahead = followed_from(0, steady, range(last, len(frames)))
    behind = followed_from(1, reversed_task(steady), range(first, -1, -1))
    new = [*behind[::-1], *frames[first : last + 1], *ahead]
    cheap = mean_cost(new, usable) < SPIN_TOLERANCE * mean_cost(frames, usable)
    better = cheap and spins(new) < before
    new = with_total_effort([frames, new], int(better))
    # frames that were not tracked again have only their own effort
    new[first : last + 1] = frames[first : last + 1]
    return tracked._replace(frames=new, kept_run=kept_run if better else None)


def spin_mask(yaws: Array, usable: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """Return whether a body spins in each frame (T,).

    Args:
        yaws: (T,) radians.
        usable: (T,) whether a frame shows enough of the person.
        fps: Frames a second.
    """
    spins = np.zeros(len(yaws), dtype=bool)
    reach = max(round(SPIN_SECONDS * fps), 1)
    turned = np.abs(wrapped(yaws[reach:] - yaws[:-reach]))
    for k in np.flatnonzero((turned > SPIN_ANGLE) & usable[reach:] & usable[:-reach]):
        spins[k : k + reach + 1] = True
    return spins


def facing_consensus(
    frames: Sequence[Frame],
    cameras: Sequence[Camera],
    usable: NDArray[np.bool_],
    fps: float,
) -> NDArray[np.bool_]:
    """Return which frames (T,) agree with the likeliest sequence of yaws without spins.

    Each frame faces either where it was estimated to face or where its reflection
    faces. A reflection costs the votes of the frame, one for each camera that sees the
    person. Frames that spin or show too little have no votes.

    Args:
        frames: The T frames of a track.
        cameras: The cameras.
        usable: (T,) whether a frame shows enough of the person.
        fps: Frames a second.
    """
    yaws = np.array([frame.pose[0] for frame in frames])
    steady = ~spin_mask(yaws, usable, fps)
    # the clock stops during spins, so that they give no time to turn
    rows = np.flatnonzero(usable & steady)
    clock = steady.cumsum()
    agrees = np.zeros(len(frames), dtype=bool)
    if not len(rows):
        return agrees
    voters = [frames[k] for k in rows.tolist()]
    views = np.array([frame.areas.any(axis=1) for frame in voters])
    camera_yaws = [
        facing(cameras[int(seeing.argmax())], frame.translation)
        for frame, seeing in zip(voters, views, strict=True)
    ]
    reflected = 2.0 * np.array(camera_yaws) + np.pi - yaws[rows]
    both = np.column_stack([yaws[rows], reflected])  # (n, 2)
    votes = views.sum(axis=1) * VOTES_PER_SECOND / fps
    against = np.column_stack([np.zeros(len(rows)), votes])  # (n, 2)
    turned = np.abs(wrapped(both[1:, None] - both[:-1, :, None]))
    seconds = (clock[rows[1:]] - clock[rows[:-1]]) / fps
    excess = np.maximum(turned - MAX_TURN_RATE * seconds[:, None, None], 0.0)
    agrees[rows] = cheapest_sequence(against, EXCESS_TURN_VOTES * excess) == 0
    return agrees


def best_ends(
    frames: Sequence[Frame], start: int, stop: int, fps: float
) -> tuple[int, int]:
    """Return a good frame near the beginning of a run, and one near its end.

    These are the frames that most cameras see, and of them the cheapest. At either end
    of the whole track the run's own end is returned, because nothing continues there.
    """
    near = min(max(round(END_SECONDS * fps), 1), (stop - start + 1) // 2)

    def rank(k: int) -> tuple[int, float]:
        """Return the rank of a frame: more cameras first, then lower costs."""
        return -int(frames[k].areas.any(axis=1).sum()), frames[k].cost

    first = 0
    if start:
        first = min(range(start, start + near), key=rank)
    last = stop - 1
    if stop < len(frames):
        last = min(range(stop - 1, stop - 1 - near, -1), key=rank)
    return first, last
