"""Which leg is the left one, over a whole film by one camera.

From the side, two legs that pass each other look like two that meet and go back, and a track takes the one for the
other. But a body whose legs go back, or are exchanged in the middle of a stride, does not stay on the masks once its
motion is smooth. So legs are exchanged, for a trial, from each doubtful frame on. The costs of these trials, and of
each stretch between them as it is and exchanged, give the cheapest sequence of exchanges. Most films need no trial:
exchanged legs cost more everywhere than all that could be saved.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.bodies import ObservedFrames
from posefit.fitting.contours import ROBUST_SCALES
from posefit.fitting.landmarks import LEGS, landmark_likelihoods, side_odds
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import JOINTS, LIMBS, root_centred
from posefit.geometry.symmetry import exchanged_limbs, mirrored_poses
from posefit.motion.motion import Motion
from posefit.tracking.smoothing.smooth import Smoothed, smooth, smoothed_motion
from posefit.tracking.trajectory import cheapest_sequence, mean_cost
from posefit.uncertainty.calibration import SECOND_SIDE

ROUNDS = 3  # at most: what is exchanged in one shows the next what else is doubtful
TRIAL_SECONDS = 0.3  # before, and after, a frame from which legs are exchanged
# the same, of frames that a wrong exchange makes cost more
DOUBT_SECONDS = 0.1
# metres, rms: exchanged legs that are so near to those of the frame before may be
# theirs
PASSING = 0.16
# the same, where a smoothed frame costs so many times the median, the most around
JUMPING = 0.33
HIGH_COST = 1.3
AROUND_SECONDS = 0.08  # in which one frame stands for all
# of landmarks: of the logarithm of the odds that legs are as they are, as errors last
# for frames
ODDS_COST = 0.5
# metres: the steps of a first look, fewer than `ROBUST_SCALES`
QUICK_SCALES = (0.065, 0.045, 0.033, 0.033)
LEG_JOINTS = [
    JOINTS.index(joint) for side in ("left", "right") for joint in LIMBS[f"{side} leg"]
]


def with_cheapest_legs(
    tracked: Sequence[Frame], smoothed: Smoothed, beta: float
) -> tuple[Smoothed, NDArray[np.bool_]]:
    """Return tracked frames smoothed with their legs exchanged where that is cheaper, and in which (T,) they are.

    Where a fifth are, it stays open which of two sequences is right, this one or that with left and right exchanged:
    posteriors have both.
    """
    scene = smoothed.scene
    shape = smoothed.shape
    usable = np.array([observation.usable for observation in scene.observations])
    changed = np.zeros(len(tracked), dtype=bool)
    for _ in range(ROUNDS):
        exchanged = legs_exchanged(smoothed, tracked, usable, beta)
        pairs = zip(tracked, exchanged, strict=True)
        frames = [
            _exchanged(smoothed.scene, frame) if other else frame
            for frame, other in pairs
        ]
        if not exchanged.any():
            break
        again = smooth(scene, frames, shape, beta)
        if mean_cost(again.frames, usable) >= mean_cost(smoothed.frames, usable):
            break
        tracked = frames
        smoothed = again
        changed = changed ^ exchanged
    share = min(float(changed.mean()), 0.5)
    return smoothed._replace(
        frames=[_with_both(scene, frame, share) for frame in smoothed.frames]
    ), changed


def legs_exchanged(
    smoothed: Smoothed, frames: Sequence[Frame], usable: NDArray[np.bool_], beta: float
) -> NDArray[np.bool_]:
    """Return in which frames (T,) legs should be exchanged, as that is cheaper.

    Args:
        smoothed: the frames once they are smoothed.
        frames: as they were tracked.
        usable: (T,) which of them show enough.
        beta: that of the cost.

    """
    scene = smoothed.scene
    costs = np.array([frame.cost for frame in smoothed.frames]) * usable
    pairs = [frames, [_exchanged(scene, frame) for frame in frames]]
    here, there = (scene.motion(each) for each in pairs)
    edges = doubtful(here, there, costs, usable)
    odds = _odds(scene, here)
    reach = max(round(TRIAL_SECONDS * scene.fps), 2)
    # a few steps are enough to see where nothing is in doubt
    quick = _smoothed_costs(scene, there, beta, QUICK_SCALES)
    near = max(round(DOUBT_SECONDS * scene.fps), 1)
    edges, anything = in_doubt(edges, near, costs, quick - costs + odds, usable)
    if not anything:
        return np.zeros(len(frames), dtype=bool)
    added = _smoothed_costs(scene, there, beta) - _smoothed_costs(scene, here, beta)
    exchanged = np.zeros(len(frames), dtype=np.int64)
    switches = []
    for edge in edges:  # in the order of time: two that are near each other may be one
        rows = range(max(edge - reach, 0), min(edge + reach, len(frames)))
        later = np.arange(len(frames)) >= edge
        window = replace(scene, observations=[scene.observations[k] for k in rows])
        trials = [
            [pairs[which[k]][k] for k in rows]
            for which in (exchanged, exchanged ^ later)
        ]
        same, other = (
            _smoothed_costs(window, window.motion(trial), beta).sum()
            for trial in trials
        )
        switch = (
            other - same - np.where(exchanged, -added, added)[edge : rows.stop].sum()
        )
        switches.append(abs(switch))
        exchanged ^= later & (switch < 0.0)
    starts = [0, *edges]
    stops = [*edges, len(frames)]
    stretches = np.add.reduceat(np.where(exchanged, -1.0, 1.0) * (added + odds), starts)
    steps = np.reshape(switches, (-1, 1, 1)) * (1.0 - np.eye(2))
    others = cheapest_sequence(
        np.column_stack([np.zeros(len(starts)), stretches]), steps
    )
    others = np.repeat(others, np.subtract(stops, starts))
    return np.asarray(exchanged != others)


def in_doubt(
    edges: Sequence[int],
    reach: int,
    costs: Array,
    added: Array,
    usable: NDArray[np.bool_],
) -> tuple[list[int], bool]:
    """Return the edges of the stretches that may be better with exchanged legs, and whether any stretch may be.

    To exchange the legs between two edges adds `added` (T,) to the cost of each frame there. All that it can save is
    what frames near these edges, closer than `reach`, cost more than others, where they do clearly: `costs` (T,) are
    those of smoothed frames.
    """
    typical = np.median(costs[usable])
    excess = np.where(usable & (costs > HIGH_COST * typical), costs - typical, 0.0)
    ends = [0, *edges, len(costs)]
    near = [np.zeros(len(costs), dtype=bool) for _ in ends]
    for edge, rows in zip(edges, near[1:-1], strict=True):
        rows[max(edge - reach, 0) : edge + reach] = True
    kept = set[int]()
    anything = False
    for first, start in enumerate(ends[:-1]):
        for last in range(first + 1, len(ends)):
            saved = excess[near[first] | near[last]].sum()
            if added[start : ends[last]].sum() < saved:
                anything = True
                kept |= {start, ends[last]}
    return [edge for edge in edges if edge in kept], anything


def doubtful(
    here: Motion, there: Motion, costs: Array, usable: NDArray[np.bool_]
) -> list[int]:
    """Return the frames from which legs may have to be exchanged: those of `there` are near to those of the one before.

    They need not be as near where the smoothed frame costs more than others. Frames that are not `usable` are left out.
    """
    legs, exchanged = (
        root_centred(motion.skeleton.joints(motion.poses))[:, LEG_JOINTS]
        for motion in (here, there)
    )
    off = np.append(
        np.inf, np.sqrt(((exchanged[1:] - legs[:-1]) ** 2).sum(axis=2).mean(axis=1))
    )
    around = max(round(AROUND_SECONDS * here.fps), 1)

    def least(values: Array) -> NDArray[np.bool_]:
        """Return where values (T,) are the least around."""
        padded = np.pad(values, around, constant_values=np.inf)
        return np.asarray(
            values
            <= np.lib.stride_tricks.sliding_window_view(padded, 2 * around + 1).min(
                axis=1
            )
        )

    passing = (off < PASSING) & least(off)
    jumping = (
        (off < JUMPING) & least(-costs) & (costs > HIGH_COST * np.median(costs[usable]))
    )
    return [int(frame) for frame in np.flatnonzero((passing | jumping) & usable)]


def _exchanged(scene: Scene, frame: Frame) -> Frame:
    """Return a frame with exchanged legs; so are those of its posterior."""
    skeleton = scene.body.skeleton
    posterior = frame.posterior
    if posterior is not None:
        posterior = replace(
            posterior, poses=exchanged_limbs(skeleton, posterior.poses, "legs")
        )
    return replace(
        frame,
        pose=exchanged_limbs(skeleton, frame.pose[None], "legs")[0],
        posterior=posterior,
    )


def _with_both(scene: Scene, frame: Frame, share: float) -> Frame:
    """Return a frame whose posterior has a share of poses with left and right exchanged, where that is not small."""
    posterior = frame.posterior
    if posterior is None or share < SECOND_SIDE:
        return frame
    poses = np.concatenate(
        [posterior.poses, mirrored_poses(scene.body.skeleton, posterior.poses)]
    )
    weights = np.concatenate(
        [(1.0 - share) * posterior.weights, share * posterior.weights]
    )
    places = np.tile(posterior.translations, (2, 1))
    model = posterior.recalibration and replace(
        posterior.recalibration, second_side=0.0
    )
    both = replace(
        posterior,
        poses=poses,
        translations=places,
        weights=weights,
        recalibration=model,
    )
    return replace(frame, posterior=both)


def _smoothed_costs(
    scene: Scene, motion: Motion, beta: float, scales: Sequence[float] = ROBUST_SCALES
) -> Array:
    """Return the costs (T,) of a motion's frames once it is smoothed; 0 for those that show too little."""
    scene, motion, _ = smoothed_motion(scene, motion, None, beta, scales)
    usable = np.array([observation.usable for observation in scene.observations])
    costs = np.zeros(len(motion))
    if usable.any():
        seen = ObservedFrames.of(each for each in scene.observations if each.usable)
        costs[usable] = seen.costs_of(
            scene.body,
            scene.cameras,
            motion.poses[usable],
            motion.translations[usable],
            beta,
        )
    return costs


def _odds(scene: Scene, motion: Motion) -> Array:
    """Return what landmarks add (T,) to the cost of frames with exchanged legs."""
    costs = np.zeros(len(motion))
    for k, observation in enumerate(scene.observations):
        if observation.landmarks is not None:
            marks = motion.skeleton, scene.cameras, observation.landmarks
            likelihoods = landmark_likelihoods(
                *marks, motion.poses[k : k + 1], motion.translations[k : k + 1]
            )
            costs[k] = ODDS_COST * side_odds(likelihoods[0])[LEGS]
    return costs
