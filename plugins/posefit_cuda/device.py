"""The device `cuda`, and the check for a GPU."""

from dataclasses import dataclass
from typing import final

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Areas, Silhouette


@final
@dataclass(frozen=True)
class Cuda:
    """An NVIDIA GPU, programmed with numba-cuda. Only run in numba's simulator so far.

    Raises InputError if there is no GPU.
    """

    def __post_init__(self) -> None:
        missing = _missing()
        if missing:
            raise InputError(f"device cuda needs an NVIDIA GPU, got {missing}")

    def areas(
        self,
        body: Body,
        camera: Camera,
        silhouette: Silhouette,
        poses: Array,
        translations: Array,
    ) -> Areas:
        """Return R, B, Y (n, 3) in pixels of poses (n, 66) at translations (n, 3)."""
        from posefit_cuda.areas import areas_on_device

        return areas_on_device(body, camera, silhouette, poses, translations)


def _missing() -> str | None:
    """Return why there is no GPU; None if there is one, or numba's simulator."""
    try:
        from numba import cuda
    except ImportError as error:
        return f"numba-cuda cannot be imported: {error}"
    if cuda.is_available():
        return None
    return "no working NVIDIA driver, or no GPU"
