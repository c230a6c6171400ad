"""Whether a device is available, and silhouettes on one."""

from copy import copy
from importlib.util import find_spec

from posefit.errors import InputError
from posefit.reading import quoted
from posefit.silhouette.mask import Silhouette

DEVICES = ("cpu", "cuda")


def check_device(device: str) -> None:
    """Raise InputError for an unknown device, and for one that is not available."""
    if device not in DEVICES:
        raise InputError(
            f"device must be one of {', '.join(DEVICES)}, got {quoted(device)}"
        )
    if device == "cuda" and (missing := _missing()):
        raise InputError(
            f"device cuda needs an NVIDIA GPU and posefit[gpu], got {missing}"
        )


def _missing() -> str | None:
    """Return what there is instead of a device; None where there is one, which may be numba's simulator of one."""
    if find_spec("numba_cuda") is None:
        return "no library numba-cuda"
    try:
        from numba import cuda
    except ImportError as error:
        return f"numba-cuda without what it needs: {error}"
    if cuda.is_available():
        return None
    return "no driver of NVIDIA's that answers, or no GPU"


def moved_to(silhouette: Silhouette, device: str) -> Silhouette:
    """Return the silhouette on a device, "cpu" or "cuda": poses that are compared with it are drawn and counted there.

    Raises InputError where there is no such device.
    """
    check_device(device)
    if device == silhouette.device:
        return silhouette
    # its borders, too, which a smaller picture has from a larger one
    moved = copy(silhouette)
    object.__setattr__(moved, "device", device)
    return moved
