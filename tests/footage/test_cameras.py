"""Real cameras: the unit of their calibrations, which one of a file is meant, what is guessed where nothing is said."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.footage.extraction import Extraction
from posefit.footage.options import SourceOptions
from posefit.footage.pairing import calibrated, order_by_name
from posefit.footage.source import scene_of
from posefit.footage.world import unit_of_heights
from posefit.geometry.calibration import Calibration
from posefit.geometry.units import METRES, UNIT_NAMES
from posefit.silhouette.cost import project
from tests.cases import each
from tests.commands import error_of, printed
from tests.footage.conftest import (
    EMPTY,
    FRAMES,
    NOBODY,
    SIZE,
    camera,
    film,
    stack,
    truth,
    walk,
)
from tests.footage.test_footage import toml
from tests.geometry import programs
from tests.geometry.test_dialects import OF_ONE_UNIT

AZIMUTHS = (np.pi / 2, 0.6)


def calibration(path: Path, metres: float, azimuths: Any = AZIMUTHS) -> Path:
    """Write calibrations in a unit of so many metres."""
    placed = [camera(azimuth) for azimuth in azimuths]
    text = toml(path, *placed).read_text()
    for one in placed:
        text = text.replace(
            str(one.translation.tolist()), str((one.translation / metres).tolist())
        )
    path.write_text(text)
    return path


def views(tmp_path: Path) -> list[Path]:
    named = zip("ab", AZIMUTHS, strict=True)
    return [
        stack(tmp_path / f"{name}.npz", truth(azimuth)[8:14], fps=25.0)
        for name, azimuth in named
    ]


@each("unit", ["m", "cm", "mm", "inch"])
def test_the_unit_of_calibrations_is_recognised_by_the_persons_height(
    tmp_path: Path, unit: Any
) -> None:
    path = calibration(tmp_path / "two.toml", METRES[unit])
    for stated in (None, unit):
        scene = scene_of(
            views(tmp_path),
            SourceOptions(camera=[path], up="y", unit=stated, height=1.74),
        )
        assert np.linalg.norm(scene.anchor - walk().translations[8]) < 0.3
        np.testing.assert_allclose([one.position for one in scene.cameras], [camera(a).position for a in AZIMUTHS], atol=1e-6)  # fmt: skip
        assert list(scene.guesses) == (
            [] if stated else [f"the calibration is in {UNIT_NAMES[unit]}"]
        )
    with pytest.raises(
        ValueError,
        match="got .*: the masks show .* or the calibrations are in another order or unit",
    ):
        scene_of(
            views(tmp_path),
            SourceOptions(camera=[path], up="y", unit="foot", height=1.74),
        )


@each("unit", ["m", "mm", "cm"])
def test_the_unit_of_one_camera_is_recognised_by_its_distance(
    tmp_path: Path, unit: Any
) -> None:
    path = calibration(tmp_path / "one.toml", METRES[unit], AZIMUTHS[:1])
    scene = scene_of(
        views(tmp_path)[:1], SourceOptions(camera=[path], up="y", height=1.74)
    )
    assert list(scene.guesses) == [f"the calibration is in {UNIT_NAMES[unit]}"]
    assert np.linalg.norm(scene.anchor - walk().translations[8]) < 1.0
    drawn = scene_of(["walk"], SourceOptions(camera=[path], up="y", frames=(0, 2)))
    assert drawn.observations[0].silhouettes[0].mask.any()
    assert drawn.guesses == scene.guesses
    words = [
        "--camera",
        path,
        "--up",
        "y",
        "--frames",
        "0:2",
        "--method",
        "random",
        "--evaluations",
        "40",
    ]
    assert printed("track", "walk", *words)["guesses"] == list(scene.guesses)


@each("unit", [1.0, 0.001, 0.37, 41.0])
def test_a_scene_that_was_reconstructed_has_the_scale_of_the_person(
    tmp_path: Path, unit: float
) -> None:
    known = [
        replace(
            one,
            scale="free",
            translation=one.translation / unit,
            upright=False,
        )
        for one in (Calibration.of(camera(a), f"c{a:.1f}") for a in AZIMUTHS)
    ]
    scene = scene_of(views(tmp_path), SourceOptions(camera=known, up="y", height=1.74))
    distances = [np.linalg.norm(one.position) for one in scene.cameras]
    usual = [np.linalg.norm(camera(a).position) for a in AZIMUTHS]
    if unit in (1.0, 0.001):  # a unit that files have
        np.testing.assert_allclose(distances, usual, rtol=1e-9)
        return
    # the masks are about as tall as the person
    np.testing.assert_allclose(distances, usual, rtol=0.2)
    (said,) = [guess for guess in scene.guesses if "by the person's height" in guess]
    assert said.startswith("the calibration's unit is ")


@each("unit", ["m", "cm", "mm", "inch"])
@each("order", [(0, 1), (1, 0)])
def test_a_camera_whose_unit_is_known_keeps_it_beside_one_whose_unit_is_guessed(
    tmp_path: Path, unit: Any, order: tuple[int, int]
) -> None:
    stated = Calibration.of(camera(AZIMUTHS[0]), "a")
    open_one = Calibration.of(camera(AZIMUTHS[1]), "b")
    known = [
        stated,
        replace(
            open_one, scale="open", translation=open_one.translation / METRES[unit]
        ),
    ]
    sources = views(tmp_path)
    scene = scene_of(
        [sources[k] for k in order],
        SourceOptions(camera=[known[k] for k in order], up="y", height=1.74),
    )
    for k, one in zip(order, scene.cameras, strict=True):
        np.testing.assert_allclose(
            one.position, camera(AZIMUTHS[k]).position, atol=1e-6
        )
    assert list(scene.guesses) == [f"the calibration is in {UNIT_NAMES[unit]}"]


@pytest.mark.parametrize("program", OF_ONE_UNIT)
def test_a_file_of_a_program_with_one_unit_needs_no_unit(
    tmp_path: Path, program: str
) -> None:
    write, suffix, _ = programs.SAMPLES[program]
    path = tmp_path / f"left{suffix}"
    path.write_text(write())
    masks = np.zeros((2, 480, 640), dtype=bool)
    masks[:, 100:400, 280:340] = True
    scene = scene_of([masks], SourceOptions(camera=[path], height=1.7))
    np.testing.assert_allclose(scene.cameras[0].position, [0, 1, 4], atol=1e-6)
    assert not [guess for guess in scene.guesses if "calibration is in" in guess]
    with pytest.raises(
        ValueError, match="unit must be left out for 'left', which is in metres"
    ):
        scene_of([masks], SourceOptions(camera=[path], height=1.7, unit="mm"))


def test_a_place_that_was_added_to_a_chain_may_be_in_any_unit(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text(programs.kalibr(rvec=[np.pi / 2, 0.0, 0.0], tvec=[0, 1000, 4000]))
    masks = np.zeros((2, 480, 640), dtype=bool)
    masks[:, 100:400, 280:340] = True
    scene = scene_of([masks], SourceOptions(camera=[path], height=1.7))
    assert "the calibration is in millimetres" in scene.guesses


def test_a_camera_under_the_floor_is_doubted(tmp_path: Path) -> None:
    path = tmp_path / "left.json"
    masks = np.zeros((2, 480, 640), dtype=bool)
    masks[:, 100:400, 280:340] = True
    for tvec, doubted in (([0.0, 1.0, 4.0], False), ([0.0, -4.0, 1.0], True)):
        path.write_text(programs.opencv(tvec=tvec))
        scene = scene_of([masks], SourceOptions(camera=[path], height=1.7))
        said = [
            guess for guess in scene.guesses if "below the origin of the world" in guess
        ]
        assert bool(said) == doubted


def test_a_height_half_or_twice_the_usual_is_no_other_unit() -> None:
    assert [unit_of_heights(ratio) for ratio in (0.5, 1.0, 1.9)] == ["m"] * 3
    assert [unit_of_heights(ratio) for ratio in (1.9e3, 150.0, 45.0)] == [
        "mm",
        "cm",
        "inch",
    ]


def test_one_of_several_cameras_is_chosen_by_name(tmp_path: Path) -> None:
    path = calibration(tmp_path / "two.toml", 1.0)
    source = views(tmp_path)[0]
    scene = scene_of([source], SourceOptions(camera=[f"{path}:cam0"], up="y"))
    np.testing.assert_allclose(
        scene.cameras[0].position, camera(AZIMUTHS[0]).position, atol=1e-6
    )
    error = error_of("track", source, "--camera", path, "--out", tmp_path / "out")
    assert (
        "camera must be given for each view, 1, got 2: cam0, cam1; FILE:NAME is one of a file"
        in error
    )
    assert (
        "unit applies only to calibrations and files of motions, got 'mm' for masks"
        in error_of("track", source, "--unit", "mm")
    )


@pytest.fixture(scope="module")
def apart() -> tuple[list[Any], Any]:
    """Return cameras, and of each what shows of two people who walk beside each other (cameras, people, T, h, w).

    One camera sees the second person later, and the other the first.
    """
    cameras = [
        replace(camera(azimuth), focal=0.8 * camera(azimuth).focal)
        for azimuth in AZIMUTHS
    ]
    motion = walk()
    shown = np.zeros((2, 2, FRAMES, *SIZE[::-1]), dtype=bool)
    body = posefit.Body.of(motion.skeleton)
    for view, person in product(range(2), range(2)):
        for k in range(0 if view == person else 20, FRAMES):
            aside = 0.45 - 0.9 * person
            place = motion.translations[k] * [1.0, 1.0, 0.5] + [aside, 0.0, -aside]
            shown[view, person, k] = project(
                body, cameras[view], motion.poses[k], place
            )
    return cameras, shown


@each(
    ("kind", "person"),
    [
        ("masks", None),
        ("masks", 1),
        ("masks", 2),
        ("video", None),
        ("video", 2),
        ("video by extraction", 2),
    ],
)
def test_every_camera_follows_the_person_whom_the_first_one_follows(
    apart: tuple[list[Any], Any], kind: str, person: int | None, tmp_path: Path
) -> None:
    cameras, shown = apart
    sources = [
        tmp_path / f"{name}.{'npz' if kind == 'masks' else 'avi'}" for name in "ab"
    ]
    for source, people in zip(sources, shown, strict=True):
        if kind == "masks":
            np.savez(source, masks=people.any(axis=0).astype(np.uint8), fps=25.0)
        else:
            film(
                source, [NOBODY] * EMPTY + [*people[0]], [NOBODY] * EMPTY + [*people[1]]
            )
    path = toml(tmp_path / "two.toml", *cameras)
    how = Extraction(background=f"0:{EMPTY}")
    view: dict[str, Any] = {"person": person}
    if kind != "masks":
        view |= {"frames": (EMPTY, None), "extraction": how}
    if kind == "video by extraction":
        view |= {"person": None, "extraction": replace(how, person=person)}
    scene = scene_of(sources, SourceOptions(camera=[path], up="y", height=1.74, **view))
    followed = 0 if person is None else person - 1
    for silhouette, people in zip(
        scene.observations[FRAMES - 5].silhouettes, shown, strict=True
    ):
        assert silhouette.mask.any()
        assert (
            silhouette.mask & people[followed, FRAMES - 5]
        ).sum() > 0.75 * silhouette.mask.sum()
    assert any(
        f"person {followed + 1} is followed, --person N another" in warning
        for warning in scene.warnings
    )
    assert any(
        f"person {2 - followed} is followed, as by the first camera" in warning
        for warning in scene.warnings
    )


@each("value", [2, np.int64(2), [40.0, 60], (np.float32(40), 60.0)])
def test_the_person_of_an_extraction_is_checked_as_the_option_is(value: Any) -> None:
    person = Extraction(person=value).person
    assert person == SourceOptions(person=value).person
    assert person in (2, (40.0, 60.0))


@each("value", [0, -1, "2", 1.5, True, [1, 2, 3]])
def test_no_other_value_is_the_person_of_an_extraction(value: Any) -> None:
    for options in (Extraction, SourceOptions):
        with pytest.raises(ValueError, match="person must be"):
            options(person=value)


def test_two_choices_of_a_person_are_refused(tmp_path: Path) -> None:
    source = film(tmp_path / "a.avi", [NOBODY] * 3, [NOBODY] * 3)
    for person in (1, (40.0, 60.0)):
        options = SourceOptions(person=person, extraction=Extraction(person=2))
        with pytest.raises(
            ValueError, match=r"person must be given once, .*, and 2 of the extraction"
        ):
            scene_of([source], options)


def test_everything_that_is_guessed_is_reported(tmp_path: Path) -> None:
    (source, _), bare = views(tmp_path), tmp_path / "bare.yml"
    assert list(scene_of([source]).guesses) == [
        "a level camera, 40 degrees across: distances and sizes are only as good as this guess",
        "a person of 1.74 m",
    ]
    bare.write_text("K: [[200, 0, 79.5], [0, 200, 59.5], [0, 0, 1]]\n")
    scene = scene_of([source], SourceOptions(camera=[bare], height=1.7))
    assert list(scene.guesses) == [
        "the camera is level, which its calibration does not state",
        "the calibration is for pictures of this size, which it does not state",
    ]
    bare.write_text("K: [[200, 0, 79.5], [0, 200, 259.5], [0, 0, 1]]\n")
    with pytest.raises(
        ValueError,
        match="camera 'bare' must be calibrated for 160x120, .* got a centre of 79.5x259.5",
    ):
        scene_of([source], SourceOptions(camera=[bare]))


def _named(name: str) -> Calibration:
    return Calibration(
        name,
        (160, 120),
        np.array([[200.0, 0.0, 79.5], [0.0, 200.0, 59.5], [0.0, 0.0, 1.0]]),
        np.zeros(4),
        np.eye(3),
        np.zeros(3),
    )


@each(
    ("sources", "cameras", "order"),
    [
        (["a.npz", "b.npz"], ["a", "b"], [0, 1]),
        (["a.npz", "b.npz"], ["b", "a"], [1, 0]),
        (["x/A.mp4", "x/B.mp4"], ["b", "a"], [1, 0]),
        # as text sorts them, and as people do
        (["7.mp4", "9.mp4", "11.mp4"], ["11", "7", "9"], [1, 2, 0]),
        (["cam7.mp4", "cam9.mp4", "cam11.mp4"], ["11", "7", "9"], [1, 2, 0]),
        (["walk-a.mp4", "walk-b.mp4"], ["cam_b", "cam_a"], [1, 0]),
        (["cam1.mp4", "cam2.mp4"], ["cam02", "cam01"], [1, 0]),
        (["left/masks.npz", "right/masks.npz"], ["right", "left"], [1, 0]),
        (["out/left/m.npz", "out/right/m.npz"], ["right", "left"], [1, 0]),
        (["run_21985.avi", "run_22001.avi"], ["22001", "21985"], [1, 0]),
        (["take2_Miqus_1_21985.avi", "take2_Miqus_3_22001.avi"], ["22001", "21985"], [1, 0]),
        # names that say nothing, or not the same
        (["x.npz", "y.npz"], ["b", "a"], [0, 1]),
        (["1.npz", "2.npz"], ["1", "0"], [0, 1]),
        (["m.npz", "m.npz"], ["b", "a"], [0, 1]),
    ],
)  # fmt: skip
def test_cameras_go_with_the_sources_of_their_names_or_else_in_order(
    sources: list[str], cameras: list[str], order: list[int]
) -> None:
    known = [
        replace(_named(name), translation=np.full(3, float(k)))
        for k, name in enumerate(cameras)
    ]
    assert order_by_name(known, sources) == order
    paired = calibrated(known, [None] * len(known), sources)
    assert [each.name for each in paired] == [cameras[k] for k in order]


def test_names_that_fit_two_orders_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot tell which camera took which source"):
        order_by_name([_named("a"), _named("b")], ["b/a.npz", "a/b.npz"])


def test_names_decide_before_the_order_of_a_calibration_file(
    tmp_path: Path,
) -> None:
    path = calibration(tmp_path / "two.toml", 1.0)
    first, second = (
        path.read_text().replace("cam0", "a").replace("cam1", "b").split("[b]")
    )
    texts = {"ab.toml": f"{first}[b]{second}", "ba.toml": f"[b]{second}{first}"}
    scenes = []
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        scenes.append(
            scene_of(views(tmp_path), SourceOptions(camera=[tmp_path / name], up="y"))
        )
    for one, other in zip(scenes[0].cameras, scenes[1].cameras, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
