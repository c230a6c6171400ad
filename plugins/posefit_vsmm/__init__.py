"""A variable-structure multiple-model tracker, CN101894278 (2010): `vsmm`.

It follows a person in milliseconds a frame, by joints that rules find in the silhouette, as long as one of its motion
models knows what the person does: walking, arms held out, jumping jacks, jumps, squats. Its steps, by number:

- 1: `preprocess`, the outline and the skeleton line of a mask.
- 2: `joints`, where 17 points of the body are, with hidden ones predicted.
- 3: `motion`, how a state, defined in `state`, goes on to the next frame.
- 4, 5: `groups`, which models belong together, and which group is the likeliest.
- 6: `measurement`, what cameras measure of a state (6.1), and `imm`, the filter.
- 7 to 9: `switching`, when a group comes into force and when it ends.

`tracker` is `vsmm`, from its settings to a frame.

>>> import posefit
>>> track = posefit.track("jacks", method="vsmm", frames=(0, 3), translation="aligned", view_degrees=0.0)
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
