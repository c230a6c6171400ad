"""A variable-structure multiple-model tracker, CN101894278 (2010): `vsmm`; and `sapso+vsmm`, a swarm led by it.

`imm`, its filter, knows nothing of bodies: any models of any state can be given to it.
"""

from posefit import hookimpl
from posefit.hooks import RegisterTracker


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    from posefit_vsmm.joined.tracker import joined
    from posefit_vsmm.tracker import vsmm

    register("vsmm", vsmm)
    register("sapso+vsmm", joined)
