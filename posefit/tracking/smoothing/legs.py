"""Which leg is the left one, over a whole film by one camera.

From the side, two legs that pass each other look like two legs that meet and go back,
and a track may confuse the two. But if legs go back, or are exchanged in
the middle of a stride, the body leaves the masks once its motion is smooth. So trials
exchange the legs from each doubtful frame on. The costs of these trials, and of each
stretch between them unchanged and exchanged, give the cheapest sequence of exchanges.
Most films need no trial, because exchanged legs cost more everywhere than an exchange
could save.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.contours import ROBUST_SCALES
from posefit.fitting.landmarks import LEGS, landmark_likelihoods, side_odds
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import JOINTS, LIMBS, root_centred
from posefit.geometry.symmetry import exchanged_limbs, mirrored_poses
from posefit.motion.motion import Motion
from posefit.silhouette.sharing import shares_of, work_through
from posefit.tracking.smoothing.contours import Borders
from posefit.tracking.smoothing.smooth import (
    Smoothed,
    areas_and_costs,
    smooth,
    smoothed_motion,
)
from posefit.tracking.trajectory import cheapest_sequence, mean_cost
from posefit.uncertainty.calibration import SECOND_SIDE

ROUNDS = 3  # at most; the exchanges of a round show what else is doubtful
TRIAL_SECONDS = 0.3  # length of a trial before and after its frame
# A wrong exchange raises the costs of frames for this time before and after it.
DOUBT_SECONDS = 0.1
# Metres, rms. An exchange is considered if the exchanged legs are this near to the legs
# of the frame before.
PASSING = 0.16
# The same if a smoothed frame costs more than all around it, and more than HIGH_COST
# times the median.
JUMPING = 0.33
HIGH_COST = 1.3
AROUND_SECONDS = 0.08  # at most one frame is doubtful within this time
# Factor on the logarithm of the landmarks' odds that legs are right. It is below 1
# because the errors of landmarks last for several frames.
ODDS_COST = 0.5
# Metres: the reach of each step of a first look, which has fewer than `ROBUST_SCALES`.
QUICK_SCALES = (0.065, 0.045, 0.033, 0.033)
LEG_JOINTS = [
    JOINTS.index(joint) for side in ("left", "right") for joint in LIMBS[f"{side} leg"]
]


def with_cheapest_legs(
    tracked: Sequence[Frame],
    smoothed: Smoothed,
    beta: float,
    threads: int = 1,
    borders: Borders | None = None,
) -> tuple[Smoothed, NDArray[np.bool_]]:
    """Return smoothed frames with legs exchanged wherever that is cheaper.

    If legs are exchanged in a fifth of the frames, either this sequence is right or the
    one with left and right exchanged. The posteriors then have both.

    Args:
        tracked: The tracked frames.
        smoothed: The same, smoothed.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        threads: Number of threads. Does not change the result.
        borders: The borders of the scene's masks, if other fits share them.

    Returns:
        The smoothed frames, and whether legs are exchanged in each of them (T,).
    """
    scene = smoothed.scene
    shape = smoothed.shape
    borders = borders or Borders(scene.observations)
    usable = np.array([observation.usable for observation in scene.observations])
    changed = np.zeros(len(tracked), dtype=bool)
    for _ in range(ROUNDS):
        exchanged = legs_exchanged(smoothed, tracked, usable, beta, threads, borders)
        if not exchanged.any():
            break
        frames = list[Frame]()
        for frame, is_exchanged in zip(tracked, exchanged, strict=True):
            if is_exchanged:
                frame = _exchanged(smoothed.scene, frame)
            frames.append(frame)
        again = smooth(scene, frames, shape, beta, borders)
        if mean_cost(again.frames, usable) >= mean_cost(smoothed.frames, usable):
            break
        tracked = frames
        smoothed = again
        changed = changed ^ exchanged
    share = min(float(changed.mean()), 0.5)
    frames = [_with_both(scene, frame, share) for frame in smoothed.frames]
    return smoothed._replace(frames=frames), changed


def legs_exchanged(
    smoothed: Smoothed,
    frames: Sequence[Frame],
    usable: NDArray[np.bool_],
    beta: float,
    threads: int = 1,
    borders: Borders | None = None,
) -> NDArray[np.bool_]:
    """Return in which frames (T,) exchanged legs are cheaper.

    Args:
        smoothed: The smoothed frames.
        frames: The tracked frames.
        usable: (T,) whether a frame shows enough of the person.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        threads: Number of threads. Does not change the result.
        borders: The borders of the scene's masks, if other fits share them.
    """
    scene = smoothed.scene
    borders = borders or Borders(scene.observations)
    costs = np.array([frame.cost for frame in smoothed.frames]) * usable
    # the frames as tracked (0), and with exchanged legs (1)
    tracks = [frames, [_exchanged(scene, frame) for frame in frames]]
    motion, exchanged_motion = (scene.motion(track) for track in tracks)
    edges = doubtful(motion, exchanged_motion, costs, usable)
    odds = _odds(scene, motion)
    # a few steps are enough to see which stretches are beyond doubt
    (quick,) = _smoothed_costs(scene, [exchanged_motion], beta, borders, QUICK_SCALES)
    near = max(round(DOUBT_SECONDS * scene.fps), 1)
    edges, anything = in_doubt(edges, near, costs, quick - costs + odds, usable)
    if not anything:
        return np.zeros(len(frames), dtype=bool)

    exchanged_costs, unchanged_costs = _smoothed_costs(
        scene, [exchanged_motion, motion], beta, borders, threads=threads
    )
    added = exchanged_costs - unchanged_costs
    reach = max(round(TRIAL_SECONDS * scene.fps), 2)
    exchanged = np.zeros(len(frames), dtype=np.int64)
    switches = []
    latest = 0  # whether legs are exchanged from the latest edge on
    # in the order of time, because two edges near each other may be one exchange
    for edge in edges:
        rows = range(max(edge - reach, 0), min(edge + reach, len(frames)))
        observations = [scene.observations[k] for k in rows]
        window = replace(scene, observations=observations, count=len(observations))
        trials = []
        for later in (latest, 1 - latest):
            exchanged[edge:] = later
            trial = [tracks[exchanged[k]][k] for k in rows]
            trials.append(window.motion(trial))
        same, other = _smoothed_costs(
            window, trials, beta, borders.starting_at(rows.start), threads=threads
        )
        # The trials differ by the exchanged legs from the edge on, and by the change at
        # the edge. The first part is already in `added`; the cost of the change
        # remains.
        later_cost = added[edge : rows.stop].sum()
        if latest:
            later_cost = -later_cost
        switch = other.sum() - same.sum() - later_cost
        switches.append(abs(switch))
        if switch < 0.0:
            latest = 1 - latest
        exchanged[edge:] = latest
    return _cheapest_exchanges(exchanged, edges, switches, added + odds)


def _cheapest_exchanges(
    exchanged: NDArray[np.int64],
    edges: Sequence[int],
    switches: Sequence[float],
    added: Array,
) -> NDArray[np.bool_]:
    """Return in which frames (T,) legs are exchanged in the cheapest sequence.

    Args:
        exchanged: (T,) whether legs are exchanged, by the trials at each edge alone.
        edges: The frames from which legs may be exchanged.
        switches: The cost of deciding otherwise at each edge.
        added: (T,) what an exchange adds to the costs of frames.
    """
    starts = [0, *edges]
    stops = [*edges, len(exchanged)]
    # each stretch between edges is as in the trials, or exchanged
    stretches = np.add.reduceat(np.where(exchanged, -1.0, 1.0) * added, starts)
    steps = np.reshape(switches, (-1, 1, 1)) * (1.0 - np.eye(2))
    both_costs = np.column_stack([np.zeros(len(starts)), stretches])
    others = cheapest_sequence(both_costs, steps)
    others = np.repeat(others, np.subtract(stops, starts))
    return np.asarray(exchanged != others)


def in_doubt(
    edges: Sequence[int],
    reach: int,
    costs: Array,
    added: Array,
    usable: NDArray[np.bool_],
) -> tuple[list[int], bool]:
    """Return the edges of stretches that may be better with exchanged legs.

    An exchange between two edges changes the cost of each frame there by `added`. It
    saves at most the excess cost of frames near the two edges.

    Args:
        edges: The frames from which legs may be exchanged.
        reach: Frames closer to an edge than this are near it.
        costs: (T,) the costs of smoothed frames. Only clearly high ones are in excess.
        added: (T,) what an exchange adds to the costs.
        usable: (T,) whether a frame shows enough of the person.

    Returns:
        The edges, and whether any stretch may be better.
    """
    typical = np.median(costs[usable])
    excess = np.where(usable & (costs > HIGH_COST * typical), costs - typical, 0.0)
    sums = np.append(0.0, np.cumsum(excess))  # of all frames before each
    # the film begins and ends without an edge, so that nothing is near there
    ends = np.array([0, *edges, len(costs)])
    first = np.maximum(ends - reach, 0)
    stop = np.minimum(ends + reach, len(costs))
    first[-1] = len(costs)
    stop[0] = 0
    near = sums[stop] - sums[first]
    until = np.append(0.0, np.cumsum(added))[ends]
    # An exchange from a to a later b adds until[b] - until[a] to the costs, and saves
    # at most near[a] + near[b]:
    #
    #     frames    ......[ near a ]..............[ near b ]......
    #     exchanged           a -------------------- b
    #
    # It may be better if it adds less than it saves: until[b] - near[b] < until[a] +
    # near[a], so that each side belongs to one end.
    opening = until + near
    closing = until - near
    better = np.zeros(len(ends), dtype=bool)
    apart = 1
    # Frames that are near both ends of a short stretch are in both sums, and must count
    # once. So ends are compared pair by pair, first with the next one, then with the
    # one after that, until no pair has frames in common.
    while (stop[:-apart] > first[apart:]).any():
        common = np.maximum(sums[stop[:-apart]] - sums[first[apart:]], 0.0)
        saves = closing[apart:] + common < opening[:-apart]
        better[:-apart] |= saves
        better[apart:] |= saves
        apart += 1
    # Pairs farther apart have no frames in common. So it is enough to compare each end
    # with the best of all later ones, and with the best of all earlier ones.
    least_later = np.minimum.accumulate(closing[::-1])[::-1]
    better[:-apart] |= least_later[apart:] < opening[:-apart]
    most_earlier = np.maximum.accumulate(opening)
    better[apart:] |= closing[apart:] < most_earlier[:-apart]
    retained = [
        edge for edge, is_better in zip(edges, better[1:-1], strict=True) if is_better
    ]
    return retained, bool(better.any())


def doubtful(
    motion: Motion, exchanged_motion: Motion, costs: Array, usable: NDArray[np.bool_]
) -> list[int]:
    """Return the frames from which legs may have to be exchanged.

    Their exchanged legs are near to the legs of the frame before. They need not be as
    near if the smoothed frame costs more than others.

    Args:
        motion: The motion.
        exchanged_motion: The same with exchanged legs.
        costs: (T,) the costs of smoothed frames.
        usable: (T,) whether a frame shows enough of the person; others are left out.
    """
    legs, exchanged = (
        root_centred(each.skeleton.joints(each.poses))[:, LEG_JOINTS]
        for each in (motion, exchanged_motion)
    )
    squares = ((exchanged[1:] - legs[:-1]) ** 2).sum(axis=2)  # (T - 1, joints)
    off = np.append(np.inf, np.sqrt(squares.mean(axis=1)))  # (T,)
    around = max(round(AROUND_SECONDS * motion.fps), 1)

    def least(values: Array) -> NDArray[np.bool_]:
        """Return whether each of values (T,) is the least of those around it."""
        padded = np.pad(values, around, constant_values=np.inf)
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * around + 1)
        return np.asarray(values <= windows.min(axis=1))

    passing = (off < PASSING) & least(off)
    costly = costs > HIGH_COST * np.median(costs[usable])
    jumping = (off < JUMPING) & least(-costs) & costly
    return [int(frame) for frame in np.flatnonzero((passing | jumping) & usable)]


def _exchanged(scene: Scene, frame: Frame) -> Frame:
    """Return a frame with exchanged legs, also in its posterior."""
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
    """Return a frame with a share of its posterior mirrored, unless that is small."""
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
    scene: Scene,
    motions: Sequence[Motion],
    beta: float,
    borders: Borders,
    scales: Sequence[float] = ROBUST_SCALES,
    threads: int = 1,
) -> Array:
    """Return the costs (n, T) of motions once smoothed, 0 for unusable frames.

    Several threads smooth several motions side by side.
    """
    usable = np.array([observation.usable for observation in scene.observations])
    rows = np.flatnonzero(usable)
    costs = np.zeros((len(motions), len(usable)))

    def smooth_part(part: slice) -> None:
        for number in range(part.start, part.stop):
            fitted, motion, _ = smoothed_motion(
                scene, motions[number], None, beta, scales, borders
            )
            if len(rows):
                _, costs[number, rows] = areas_and_costs(fitted, motion, rows, beta)

    work_through(shares_of(len(motions), threads), threads, lambda _: (), smooth_part)
    return costs


def _odds(scene: Scene, motion: Motion) -> Array:
    """Return the costs (T,) that landmarks add to frames with exchanged legs."""
    costs = np.zeros(len(motion))
    for k, observation in enumerate(scene.observations):
        if observation.landmarks is not None:
            marks = motion.skeleton, scene.cameras, observation.landmarks
            likelihoods = landmark_likelihoods(
                *marks, motion.poses[k : k + 1], motion.translations[k : k + 1]
            )
            costs[k] = ODDS_COST * side_odds(likelihoods[0])[LEGS]
    return costs
