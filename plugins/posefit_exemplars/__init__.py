"""A tracker that follows clips instead of frames: `exemplars`.

One silhouette cannot tell a stride from its mirrored half-cycle; a sequence of them nearly always can. So states are
poses of recorded clips, each with a yaw; they go on as their clips do, at about their speed, or change to a clip that
goes on alike, turn, or jump; and what is told is the likeliest way through all frames seen, some frames later. After
Toyama and Blake, Probabilistic tracking in a metric space, 2001.

- `codes` compares poses by a few numbers each, `exemplars` are the poses and what came after each.
- `beam` says where the states of a frame may be in the next one and what that costs, `kernels` has its loop.
- `look` is what a pose costs in a frame, `window` the likeliest way through the last frames, and how likely others are.
- `sampling` draws ways as likely as they are, `doubt` says what they do not know of their own error.
- `refinement` searches around that way, `smoothing` filters what it found over time.
- `lost` says how likely a frame is lost, by what speaks for it.
- `tracker` does a frame after the other, `factory` is registered.

>>> import posefit
>>> track = posefit.track("walk-a", method="exemplars", train=["walk-b", "walk-c"], frames=(0, 10))
>>> track.measures.lost_rate
0.0
"""

from posefit import hookimpl
from posefit.hooks import RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Offer `exemplars`."""
    from posefit_exemplars.factory import exemplars

    register("exemplars", exemplars)
