"""A tracker that follows clips instead of frames: `exemplars`.

One silhouette does not distinguish a stride from its mirrored half-cycle; a sequence of them nearly always does. So
states are poses of recorded clips, each with a yaw. They continue as their clips do, at about their speed, or change to
a similar clip, turn, or jump, and the likeliest path through the frames is followed. After Toyama and Blake,
Probabilistic tracking in a metric space, 2001. From there every joint may move, until contours are those of the masks:
several hypotheses of each frame are fitted, and the likeliest sequence of them is reported some frames later.

- `exemplars` has the poses, what came after each, and codes to compare them.
- `beam` has the states that a frame may be in, and the costs of steps between them.
- `frame_costs` has the costs of poses in a frame.
- `markov` has the likeliest path through the last frames, the weights of states, and sampled paths.
- `hypotheses` has those of each frame, and the likeliest sequence.
- `smoothing` filters the estimates over time.
- `calibration` reports a frame with a posterior whose intervals hold.
- `lost_model` gives the probability that a frame is lost.
- `lookup` has the poses whose silhouettes are like an observed one, for any method.
- `kernels` has the compiled loops.
- `tracker` has the settings, and processes one frame after the other.

>>> import posefit
>>> track = posefit.track("walk-a", method="exemplars", train=["walk-b", "walk-c"], frames=(0, 10))
>>> track.measures.lost_rate
0.0
"""

from posefit import hookimpl
from posefit.hooks import RegisterStart, RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Offer `exemplars`."""
    from posefit_exemplars.tracker import ExemplarTracker

    register("exemplars", ExemplarTracker, looks_ahead=True)


@hookimpl
def posefit_register_starts(register: RegisterStart) -> None:
    """Offer `lookup`."""
    from posefit_exemplars.lookup import Lookup

    register("lookup", Lookup)
