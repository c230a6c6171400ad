"""A tracker that follows recorded clips: `exemplars`.

One silhouette does not distinguish a stride from its mirrored half-cycle; a sequence of
silhouettes nearly always does. So a state is a pose of a recorded clip with a yaw. A
state continues as its clip does, at about the recorded speed; it may also change to a
similar clip, turn, or jump. The tracker follows the likeliest path through the frames
(Toyama and Blake, Probabilistic tracking in a metric space, 2001).

Several hypotheses per frame start from that path. A fit moves every joint until the
contours of the body match the masks. The tracker reports the likeliest sequence of
fitted hypotheses, some frames later.

To change what makes a track likely, change `cost_model`; to change the candidates,
change `proposals`. docs/measured/tracker-parts.md has the effect of each part.

- `tracker`: the settings.
- `path`: both cheapest paths, through states of clips and through fitted hypotheses.
- `cost_model`: the costs of poses in a frame, and of steps between frames.
- `frame_costs`: how poses compare with the silhouettes and landmarks of a frame.
- `proposals`: the states that a frame may be in, and where hypotheses begin.
- `fits`: fits of hypotheses to contours.
- `markov`: the likeliest path in the lag window, state weights, and sampled paths.
- `exemplars`: the poses, how each clip continues, and codes that compare poses.
- `beam`: states of a frame, and the best and most diverse of them.
- `hypotheses`: hypotheses of a frame, and their motion.
- `estimate`: the estimate of a frame, which each stage passes to the next.
- `smoothing`: the filter of the estimates over time.
- `calibration`: the reported frame and its calibrated posterior.
- `lost_model`: the probability that a frame is lost.
- `lookup`: the poses whose silhouettes resemble an observed one, for any method.
- `kernels`: the compiled loops.

Example:
    >>> import posefit
    >>> track = posefit.track(
    ...     "walk-a", method="exemplars", train=["walk-b", "walk-c"], frames=(0, 10)
    ... )
    >>> track.measures.lost_rate
    0.0
"""

from posefit import hookimpl
from posefit.hooks import RegisterStart, RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Register the tracker `exemplars`."""
    from posefit_exemplars.tracker import ExemplarTracker

    register("exemplars", ExemplarTracker, looks_ahead=True)


@hookimpl
def posefit_register_starts(register: RegisterStart) -> None:
    """Register the start `lookup`."""
    from posefit_exemplars.lookup import Lookup

    register("lookup", Lookup)
