"""Scenes and silhouettes on a device that a plugin offers: poses that are compared with them are drawn there."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import partial

from posefit.fitting.check import one_of
from posefit.fitting.tracker import Observation
from posefit.footage.scene import LazyObservations, Scene
from posefit.registry import registry
from posefit.silhouette.mask import Device, Silhouette

CPU = "cpu"


def device_of(name: str) -> Device | None:
    """Return the device of a name; None for "cpu".

    Raises:
        InputError: if no plugin offers it, or this machine has none.
        ImportError: if the plugin needs a library that is not installed.

    """
    one_of("device", name, (CPU, *registry().offers["device"]))
    if name == CPU:
        return None
    device: Device = registry().offer("device", name).factory()
    return device


def moved_to(silhouette: Silhouette, device: str) -> Silhouette:
    """Return the silhouette on a device: poses that are compared with it are drawn and counted there.

    Args:
        silhouette: of one view.
        device: "cpu", or the name of a device that a plugin offers, such as "cuda".

    Returns:
        The same silhouette if it is there already, else a copy.

    Raises:
        InputError: if no plugin offers the device, or this machine has none.
        ImportError: if the plugin needs a library that is not installed.

    >>> import numpy as np
    >>> silhouette = Silhouette.of(np.ones((4, 4)))
    >>> moved_to(silhouette, "cpu") is silhouette
    True

    """
    return _moved(silhouette, device_of(device))


def on_device(scene: Scene, name: str) -> Scene:
    """Return a scene whose poses are drawn on a device. Raises InputError and ImportError as `moved_to` does."""
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
    # a copy has the borders, too, that a smaller picture was given by a larger one
    moved = copy(silhouette)
    object.__setattr__(moved, "device", device)
    return moved
