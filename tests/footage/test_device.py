"""Silhouettes and scenes on a device that a plugin offers; and a machine without one."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from posefit import Body, Camera, Silhouette, SilhouetteCost, areas, moved_to
from posefit.footage import device as devices
from posefit.footage.device import device_of, on_device
from posefit.footage.scene import Scene, synthetic
from posefit.motion import built_in
from posefit.plugin import Areas, Array, draw_population
from posefit.registry import Registry, load
from posefit.testing.problem import pose_problem
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from tests.plugins.test_registry import point, registering


@dataclass(frozen=True)
class Twin:
    """A device that counts on the CPU."""

    def areas(
        self,
        body: Body,
        camera: Camera,
        silhouette: Silhouette,
        poses: Array,
        translations: Array,
    ) -> Areas:
        COUNTED.append(len(poses))
        here = replace(silhouette, device=None)
        return areas(body, camera, here, poses, translations)


COUNTED: list[int] = []


def absent() -> Twin:
    raise ValueError("device absent needs a twin, got none")


@pytest.fixture(autouse=True)
def planted(monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = registering(("twin", Twin), ("absent", absent), hook="devices")
    needy = registering(
        ("needy", Twin), hook="devices", needs=("no_such_library", "posefit[needy]")
    )
    offered = Registry(load([point("twin", plugin), point("needy", needy)]))
    monkeypatch.setattr(devices, "registry", lambda: offered)
    COUNTED.clear()


def scene_of_two_views() -> Scene:
    motion = built_in.motion("walk", frames=2)
    return synthetic(motion, (45.0, 90.0), (64, 48), [], (None, None))


def test_poses_are_counted_on_the_device_of_a_silhouette() -> None:
    on_cpu = pose_problem().coarser(4)
    views = [moved_to(view, "twin") for view in on_cpu.silhouettes]
    there: SilhouetteCost = replace(on_cpu, silhouettes=views)
    proposals = draw_population(on_cpu.space, np.random.default_rng(7), 6)
    np.testing.assert_array_equal(there(proposals), on_cpu(proposals))
    assert COUNTED == [6]
    np.testing.assert_array_equal(
        there.coarser(2)(proposals), on_cpu.coarser(2)(proposals)
    )
    assert COUNTED == [6, 6]


def test_a_scene_on_a_device_has_its_silhouettes_there() -> None:
    scene = scene_of_two_views()
    there = on_device(scene, "twin")
    assert len(there.observations) == 2
    for observation, before in zip(there.observations, scene.observations, strict=True):
        assert [view.device for view in observation.silhouettes] == [Twin()] * 2
        np.testing.assert_array_equal(observation.translation, before.translation)
    assert on_device(scene, "cpu") is scene


def test_a_silhouette_that_is_there_is_not_copied() -> None:
    silhouette = Silhouette.of(np.ones((4, 4)))
    assert device_of("cpu") is None
    assert moved_to(silhouette, "cpu") is silhouette
    there = moved_to(silhouette, "twin")
    assert there is not silhouette
    assert moved_to(there, "twin") is there
    assert moved_to(there, "cpu").device is None


def test_one_line_says_what_a_device_needs() -> None:
    scene = scene_of_two_views()
    silhouette = Silhouette.of(np.ones((4, 4)))
    for name, cause, message in (
        (
            "tpu",
            ValueError,
            "device must be one of cpu, needy, twin, absent, got 'tpu'",
        ),
        ("absent", ValueError, "device absent needs a twin, got none"),
        ("needy", ImportError, "device needy needs the library no_such_library"),
    ):
        for use in (
            lambda name=name: moved_to(silhouette, name),
            lambda name=name: on_device(scene, name),
            lambda name=name: track_scene(scene, [], TrackOptions(device=name)),
        ):
            with pytest.raises(cause) as error:
                use()
            assert str(error.value).startswith(message)
