"""A silhouette on another device, and what is known of it."""

from copy import copy

from posefit.silhouette.cuda.device import check_device
from posefit.silhouette.drawn import belongs
from posefit.silhouette.mask import Silhouette


def moved_to(silhouette: Silhouette, device: str) -> Silhouette:
    """Return the silhouette on a device, "cpu" or "cuda": poses that are compared with it are drawn and counted there.

    Raises ValueError where there is no such device.
    """
    check_device(device)
    if device == silhouette.device:
        return silhouette
    moved = copy(silhouette)  # its borders, too, which a smaller picture has from a larger one
    object.__setattr__(moved, "device", device)
    return belongs(moved, silhouette)
