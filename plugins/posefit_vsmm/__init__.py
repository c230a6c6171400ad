"""`vsmm`, a variable-structure multiple-model tracker: CN101894278 (2010).

Rules find joints in the silhouette, and filters with motion models track them in
milliseconds per frame. The tracker works as long as one of its models describes the
motion: walking, arms held out, jumping jacks, jumps, squats. These modules implement
the steps of the patent:

- 1: `preprocess`, the outline and the skeleton line of a mask.
- 2: `joints`, detects 17 points of the body and predicts hidden ones.
- 3: `motion`, predicts the next state; `state` defines states.
- 4, 5: `groups`, the groups of models, and which group is the most probable.
- 6: `measurement`, the cameras' measurements of a state (6.1), and `imm`, the filter.
- 7 to 9: `switching`, when a group is activated and when it ends.

`tracker` has the settings, and runs these steps on each frame. `first_state` searches
for a state to start from.

Example:
    >>> import posefit
    >>> track = posefit.track(
    ...     "jacks",
    ...     method="vsmm",
    ...     frames=(0, 3),
    ...     translation="aligned",
    ...     view_degrees=0.0,
    ... )
    >>> track.summary["iou"] > 0.5
    True
"""

from posefit import hookimpl
from posefit.hooks import RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Offer `vsmm`."""
    from posefit_vsmm.tracker import VSMM

    register("vsmm", VSMM)
