"""When feet touch the ground and leave it, from joints in 3D. Zeni et al. 2008.

A foot strikes where the heel is farthest ahead of the pelvis, and lifts off where the
toes are farthest behind it. That needs no force plate, no floor and no foot at rest.
So it also works for feet that slide a little, and for bodies that a silhouette has put
a few centimetres too high. Here the ankle replaces the heel, and the root the sacrum.
"""

from dataclasses import dataclass

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.rotation import rotation_from_root_angles
from posefit.measuring.centres import PLACES
from posefit.measuring.segments import FORWARDS, SIDES
from posefit.motion.motion import Motion

# hertz: a walk has hardly any motion above it. Winter, Biomechanics and motor control,
# 2009
CUTOFF_HZ = 6.0
MIN_FPS = 2.0 * CUTOFF_HZ  # frames per second: the Nyquist rate
# hertz: the pelvis sways once in a stride, 0.8 to 1.1 times a second; turns are slower
SWAY_HZ = 0.3
# metres that a foot must swing relative to the pelvis, for an event
MIN_FOOT_SWING = 0.1
MIN_SWING_SHARE = 0.2  # and at least this share of the range of all its swings


@dataclass(frozen=True, eq=False)
class GaitEvents:
    """Times of events in frames, counted from 0 and with fractions, and the path.

    Attributes:
        strikes: Times of initial contact, by side.
        offs: Times of toe off, by side.
        heading: Unit vector (T, 2) of x and z that the pelvis faces along, without its
            sway.
        pelvis: Place (T, 2) in metres.
        ankles: Places (T, 2) in metres, by side.
    """

    strikes: dict[str, Array]
    offs: dict[str, Array]
    heading: Array
    pelvis: Array
    ankles: dict[str, Array]


def gait_events(motion: Motion) -> GaitEvents:
    """Return when the feet of a motion strike and lift off.

    There are no events if the feet do not swing.

    Raises:
        InputError: The motion has too few frames per second.
    """
    if motion.fps < MIN_FPS:
        raise InputError(
            f"fps must be at least {MIN_FPS:g} to find the events of gait, "
            f"got {motion.fps:g}"
        )
    # x and z only: the ground
    joints = low_pass(motion.joints[:, :, ::2], CUTOFF_HZ, motion.fps)
    facing = rotation_from_root_angles(motion.poses[:, :3]) @ FORWARDS
    heading = low_pass(facing[:, ::2], SWAY_HZ, motion.fps)
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)
    pelvis = joints[:, 0]

    def ahead(place: str) -> Array:
        distance = (joints[:, PLACES.index(place)] - pelvis) * heading  # (T, 2)
        return np.asarray(distance.sum(axis=1))

    # ZENI2008 (heel strike)
    strikes = {side: _tops(ahead(f"{side}_ankle")) for side in SIDES}
    offs = {side: _tops(-ahead(f"{side}_toe")) for side in SIDES}  # ZENI2008 (toe off)
    ankles = {side: joints[:, PLACES.index(f"{side}_ankle")] for side in SIDES}
    return GaitEvents(strikes, offs, heading, pelvis, ankles)


def low_pass(series: Array, cutoff: float, fps: float) -> Array:
    """Return series (T, ...) without frequencies above a limit.

    The filter is a Gaussian, which shifts nothing in time. The ends are extended by odd
    reflection, which keeps an even pace.

    Args:
        series: Values in frames.
        cutoff: Frequency in hertz of which 0.71 of the amplitude is left.
        fps: Frames per second.
    """
    width = np.sqrt(np.log(2.0)) / (2.0 * np.pi * cutoff) * fps  # frames
    reach = min(int(4.0 * width) + 1, len(series) - 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    before = 2.0 * series[0] - series[reach:0:-1]
    after = 2.0 * series[-1] - series[-2 : -reach - 2 : -1]
    longer = np.concatenate([before, series, after])
    smooth = np.zeros_like(series)
    for k, weight in enumerate(weights / weights.sum()):
        smooth += weight * longer[k : k + len(series)]
    return smooth


def _tops(series: Array) -> Array:
    """Return the times of a series' maxima, in frames with fractions.

    On both sides of a maximum the series falls by at least a fifth of its range, and by
    at least `MIN_FOOT_SWING`.
    """
    lowest, highest = np.percentile(series, [2, 98])
    step = max(MIN_FOOT_SWING, MIN_SWING_SHARE * float(highest - lowest))
    tops = [k for k, prominence in _peaks(series) if prominence >= step]
    return np.array([_between(series, k) for k in tops])


def _peaks(series: Array) -> list[tuple[int, float]]:
    """Return the local maxima of a series, each with its prominence.

    The prominence is how far the series falls from a maximum before it rises above it
    again, on the side where it falls less. Of several equal highest values in a row,
    the middle one counts.
    """
    starts = np.flatnonzero(np.append(True, np.diff(series) != 0.0))
    values = series[starts]
    ends = np.append(starts[1:], len(series))
    higher = (values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])
    peaks = []
    for k in (np.flatnonzero(higher) + 1).tolist():
        above = np.flatnonzero(values > values[k])
        first = above[above < k].max(initial=-1) + 1
        stop = above[above > k].min(initial=len(values))
        lowest = max(values[first:k].min(), values[k + 1 : stop].min())
        middle = int(starts[k] + ends[k] - 1) // 2
        peaks.append((middle, float(values[k] - lowest)))
    return peaks


def _between(series: Array, k: int) -> float:
    """Return the maximum of the parabola through a value and its neighbours."""
    before, here, after = series[k - 1 : k + 2]
    bend = before - 2.0 * here + after
    if bend < 0.0:
        return k + 0.5 * float((before - after) / bend)
    return float(k)
