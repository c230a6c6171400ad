"""The device `cuda`: draws and counts poses on an NVIDIA GPU. Not yet run on a GPU.

It follows posefit's rasteriser, with one block of threads per pose. It is only tested
in numba's simulator, where its areas equal the CPU's; its speed on a GPU is
unknown. The handbook's page "How do I draw poses on a GPU?" describes the installation.

| looking for | file |
|---|---|
| the device, and the check for a GPU | device.py |
| copies of poses and areas in parts; arrays that stay on the device | areas.py |
| one pose: the steps of its threads, compiled | launch.py |
"""

from posefit import hookimpl
from posefit.hooks import RegisterDevice


@hookimpl
def posefit_register_devices(register: RegisterDevice) -> None:
    """Register `cuda`."""
    from posefit_cuda.device import Cuda

    register("cuda", Cuda, needs=("numba_cuda", "posefit[gpu]"))
