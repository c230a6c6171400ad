"""The device `cuda`: poses are drawn and counted on an NVIDIA GPU. No GPU has run it yet.

The loops are those of posefit's rasteriser, one block of threads a pose. They are tested in numba's simulator alone,
where they count the areas that a CPU counts; their speed on a GPU is unknown. The handbook's page "How do I draw poses
on a GPU?" says how to install it.

| looking for | file |
|---|---|
| whether there is a GPU | device.py |
| thousands of poses in parts, there and back; arrays that stay there | areas.py |
| one pose: the steps of its threads, compiled | launch.py |
"""

from posefit import hookimpl
from posefit.hooks import RegisterDevice


@hookimpl
def posefit_register_devices(register: RegisterDevice) -> None:
    """Register `cuda`."""
    from posefit_cuda.device import Cuda

    register("cuda", Cuda, needs=("numba_cuda", "posefit[gpu]"))
