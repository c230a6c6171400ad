"""A variable-structure multiple-model tracker, CN101894278 (2010): `vsmm`; and `sapso+vsmm`, a swarm led by it.

It follows a person in milliseconds a frame, by joints that rules find in the silhouette, as long as one of its motion
models knows what the person does: walking, arms held out, jumping jacks, jumps, squats. Its steps, by number:

- 1, 2: `detection`, outline and skeleton line, and where 17 points of the body are (2.7: where hidden ones may be).
- 3: `motion`, how a state, defined in `state`, goes on to the next frame; `fit.motion` fitted it to CMU's clips.
- 4, 5: `groups`, which models belong together, which change into each other, and which group is the likeliest.
- 6: `sight`, what cameras measure of a state (6.1); the filter itself is a library of its own, `posefit_imm`.
- 7 to 9: `switching`, when a group comes into force and when it goes; `structure` holds the models in force. The field
  calls that model-set adaptation.

`course` follows one track, `fresh` estimates a pose from one frame, `tracker` is what is registered; `joined` leads a
swarm by the models. `kernels` has the loops.

>>> import posefit
>>> track = posefit.track("jacks", tracker="vsmm", frames=(0, 3), translation="aligned", view_degrees=0.0)
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Offer `vsmm` and `sapso+vsmm`."""
    from posefit_vsmm.joined.tracker import joined
    from posefit_vsmm.tracker import vsmm

    register("vsmm", vsmm)
    register("sapso+vsmm", joined)
