"""Move scenes and silhouettes to a device, which then rasterises poses for them."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import partial

from posefit.fitting.check import one_of
from posefit.fitting.tracker import Observation
from posefit.footage.scene import LazyObservations, Scene
from posefit.registry import registry
from posefit.silhouette.mask import Device, Silhouette

CPU = "cpu"  # the only device that needs no plugin


def device_of(name: str) -> Device | None:
    """Return the device of a name; None for "cpu".

    Raises:
        InputError: No plugin offers it, or this machine does not have it.
        ImportError: The plugin needs a library that is not installed.
    """
    one_of("device", name, (CPU, *registry().offers["device"]))
    if name == CPU:
        return None
    device: Device = registry().offer("device", name).factory()
    return device


def moved_to(silhouette: Silhouette, device: str) -> Silhouette:
    """Return a silhouette on a device, which rasterises the poses compared with it.

    Args:
        silhouette: The silhouette of one view.
        device: "cpu", or the name of a plugin's device, such as "cuda".

    Returns:
        The silhouette itself if it is on the device already, or else a copy.

    Raises:
        InputError: No plugin offers the device, or this machine does not have it.
        ImportError: The plugin needs a library that is not installed.

    Example:
        >>> import numpy as np
        >>> from posefit import Silhouette, moved_to
        >>> silhouette = Silhouette.of(np.ones((4, 4)))
        >>> moved_to(silhouette, "cpu") is silhouette
        True
    """
    return _moved(silhouette, device_of(device))


def on_device(scene: Scene, name: str) -> Scene:
    """Return a scene whose poses are rasterised on a device.

    Raises InputError and ImportError, as `moved_to` does.
    """
    device = device_of(name)
    if device is None:
        return scene
    moved = partial(_moved_observation, scene.observations, device)
    return replace(scene, observations=LazyObservations(scene.count, moved))


def _moved_observation(
    observations: Sequence[Observation], device: Device, k: int
) -> Observation:
    silhouettes = [_moved(view, device) for view in observations[k].silhouettes]
    return replace(observations[k], silhouettes=silhouettes)


def _moved(silhouette: Silhouette, device: Device | None) -> Silhouette:
    if device == silhouette.device:
        return silhouette
    # a copy keeps the extent that a smaller picture has from the full size; a
    # silhouette made again would lose it
    moved = copy(silhouette)
    object.__setattr__(moved, "device", device)
    return moved
