"""The page of a track: pictures within their room, all of a long track's marks, no links; and in a real browser."""

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.fitting.tracker import Observation
from posefit.measuring.angles import clinical_angles
from posefit.output.page import stills
from posefit.output.page.data import in_16_bits
from posefit.output.page.stills import Stills, Strip
from posefit.page.document import embedded
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from tests.report.browser import EVIL, Watched, data_in, opened
from tests.tracking.scenes import (
    MAXWELL,
    SIZE,
    exact_frames,
    uncertain_frames,
    viewed,
    walk,
)


def numbers(text: str) -> Any:
    return np.frombuffer(base64.b64decode(text), "<i2").astype(float)


def image(uri: str) -> Any:
    return cv2.imdecode(
        np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8),
        cv2.IMREAD_UNCHANGED,
    )


def test_a_strip_keeps_what_it_has_room_for_evenly() -> None:
    for count, room, every in (
        (7, 70, 1),
        (8, 70, 2),
        (14, 70, 2),
        (15, 70, 4),
        (100, 10, 128),
        (3, 0, 4),
    ):
        strip = Strip(room, 1)
        for k in range(count):
            strip.add((k, 0, 1, 1), lambda k=k: [f"{k:06d}", "more"])
        assert strip.every == every
        assert strip.pictures == [
            ((k, 0, 1, 1), f"{k:06d}", "more") for k in range(0, count, every)
        ]


def test_pictures_of_a_long_track_are_of_frames_that_the_page_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stills, "MAX_FRAMES", 10)
    scene = replace(walk(2), count=41)
    pictures, (frame, _) = Stills(scene), exact_frames(walk(2))
    assert pictures.step == 8
    for k in range(41):
        mask = np.ones(SIZE[::-1], bool)  # so large that the picture has all of it
        mask[100, : k + 1] = False
        pictures.add(frame, Observation([Silhouette.of(mask)]), None)
    (masks,) = pictures.as_dict()["masks"]
    assert masks["every"] == 8
    assert [box for box, _ in masks["pictures"]] == [(0, 0, *SIZE)] * 6
    assert [int((image(uri) == 0).sum()) for _, uri in masks["pictures"]] == [
        1,
        9,
        17,
        25,
        33,
        41,
    ]


def test_a_picture_is_of_the_part_that_mask_and_body_are_in() -> None:
    scene = walk(1)
    (frame,), mask = exact_frames(scene), scene.observations[0].silhouettes[0].mask
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))

    def about(shown: Any) -> Any:
        pictures = Stills(scene)
        pictures.add(frame, Observation([Silhouette.of(shown)]), None)
        ((box, uri),) = pictures.as_dict()["masks"][0]["pictures"]
        left, top, width, high = box
        np.testing.assert_array_equal(
            image(uri) > 0, shown[top : top + high, left : left + width]
        )
        return box

    left, top, width, high = about(mask)
    assert (top, high) == (0, SIZE[1])  # the person fills the picture's height
    space = 0.25 * (rows[-1] + 1 - rows[0])
    assert left == pytest.approx(columns[0] - space, abs=3.0)
    assert left + width == pytest.approx(columns[-1] + 1 + space, abs=3.0)
    far = np.zeros_like(mask)
    # something else is in the mask, and the body stays in the picture
    far[:20, :20] = True
    assert about(far)[:2] == (0, 0)
    assert sum(about(far)[::2]) == pytest.approx(left + width, abs=40.0)
    assert about(np.zeros_like(mask))[1] == 0


def test_pictures_of_leaves_stay_within_a_few_megabytes() -> None:
    # as hard to compress as leaves
    seed = np.random.default_rng(0).integers(0, 255, (67, 120, 3)).astype(np.uint8)
    picture = cv2.resize(seed, (960, 540), interpolation=cv2.INTER_CUBIC)
    scene = replace(walk(2), count=20, pictures=lambda: iter([picture] * 20))
    pictures, (frame, _), seen = (
        Stills(scene),
        exact_frames(walk(2)),
        scene.observations[0],
    )
    for _ in range(20):
        pictures.add(frame, seen, picture)
    strip = pictures.as_dict()["film"]
    assert strip["every"] == 1
    assert (
        sum(len(near) + len(coarse) for _, near, coarse in strip["pictures"])
        <= stills.MAX_FILM
    )
    box, near, coarse = strip["pictures"][0]
    assert image(near).shape[1] / image(near).shape[0] == pytest.approx(
        box[2] / box[3], abs=0.02
    )
    assert image(coarse).shape[0] in {height for _, (height, _) in stills.FINENESS}


def test_metres_are_stored_as_millimetres_and_unknown_values_as_a_reserved_number() -> (
    None
):
    assert numbers(in_16_bits(np.array([0.0, 0.0014, -0.0016, 1.25]))).tolist() == [
        0,
        1,
        -2,
        1250,
    ]
    assert numbers(in_16_bits(np.array([40.0, -40.0, np.inf, np.nan]))).tolist() == [
        32767,
        -32767,
        32767,
        -32768,
    ]


def test_joints_angles_and_intervals_belong_to_the_track(tmp_path: Path) -> None:
    scene = walk(4)
    truth = scene.truth
    page = viewed(
        tmp_path / "out", scene, uncertain_frames(scene, [0.0, 0.3, 0.0, 0.0])
    )
    data = data_in(page.read_text("utf-8"))
    joints = numbers(data["estimate"]).reshape(4, 27, 3)
    true = 1e3 * truth.joints
    np.testing.assert_allclose(joints - joints[0, 0], true - true[0, 0], atol=1.01)
    assert data["truth"] == data["estimate"]
    free = truth.skeleton.free
    angles = numbers(data["angles"]["values"]).reshape(4, -1) / 10.0
    np.testing.assert_allclose(
        angles, np.degrees(np.unwrap(truth.poses, axis=0)[:, free]), atol=0.051
    )
    assert data["angles"]["names"][:4] == [
        "root yaw",
        "root pitch",
        "root roll",
        "lfemur x (bone to the left knee)",
    ]
    clinical = numbers(data["clinical"]["values"]).reshape(4, -1) / 10.0
    knee = data["clinical"]["names"].index("left knee flexion")
    expected = clinical_angles(truth.skeleton, truth.poses)["left_knee_flexion"]
    np.testing.assert_allclose(clinical[:, knee], expected, atol=0.051)
    assert data["clinical"]["truth"] == data["clinical"]["values"]
    assert data["places"][3] == "left ankle"
    # nothing but the pose itself, blurred by 2 cm
    radii = numbers(data["intervals"]["joints"]).reshape(4, 3, 27)
    np.testing.assert_allclose(
        radii[0, :, 1], 20.0 * np.array([*MAXWELL.values()]), atol=1.0
    )
    assert data["intervals"]["levels"] == [50, 80, 95]
    assert data["others"]["at"] == [1]
    assert data["others"]["weights"] == pytest.approx([0.3])
    assert data["marks"] == {"held": [], "lost": [], "unknown": [1]}
    assert (
        data["verdict"]
        == "Not determined: left and right unknown in 1 of 4 frames that show enough of "
        "the person."
    )


def test_it_is_one_file_that_links_to_nothing_but_itself(tmp_path: Path) -> None:
    scene = walk(3)
    name = "</script><script>alert(1)</script>"
    text = viewed(
        tmp_path / "out", replace(scene, name=name), exact_frames(scene)
    ).read_text("utf-8")
    assert re.findall(
        r"""<[^>]*\s(?:src|href|action|srcset|data)=["']?([^"'\s>]*)""", text
    ) == ["#player"]
    assert "url(" not in text
    assert "@import" not in text
    assert text.count("</script>") == 2
    data = data_in(text)
    assert data["title"] == name
    assert data["film"] is data["intervals"] is None
    assert embedded(data["others"]) == '{"at":[],"weights":[],"joints":""}'


FRAMES = 12
MIRRORED = [0.0, 0.0, 0.3, 0.4, 0.15, *[0.0] * 7]
LOST = 5
HELD = 1


@pytest.fixture(scope="module")
def doubtful(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the viewer of a track in two cameras, of which one frame is held, two may be mirrored, and one is lost."""
    scene = walk(FRAMES, [45.0, 135.0])
    observations = list(scene.observations)
    observations[HELD] = replace(observations[HELD], usable=False)
    frames = [
        replace(frame, lost=0.9 if k == LOST else 0.1)
        for k, frame in enumerate(uncertain_frames(scene, MIRRORED))
    ]
    return viewed(
        tmp_path_factory.mktemp("doubtful") / "out",
        replace(scene, observations=observations),
        frames,
    )


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the viewer of a filmed track whose truth is unknown, and which has a hostile name."""
    scene = walk(FRAMES)
    pictures = [
        np.full((SIZE[1], SIZE[0], 3), (20 * k, 200, 40), np.uint8)
        for k in range(FRAMES)
    ]
    unknown = replace(
        scene, truth=None, name=EVIL, warnings=[EVIL], pictures=lambda: iter(pictures)
    )
    return viewed(
        tmp_path_factory.mktemp("filmed") / "out", unknown, exact_frames(scene)
    )


def picture(page: Any, canvas: str) -> Any:
    """Return what a canvas shows, (height, width, 4)."""
    return image(page.evaluate("id => document.getElementById(id).toDataURL()", canvas))


def waited(browser: Watched, condition: Callable[[], Any]) -> None:
    """Wait until a condition is true: two minutes at the most."""
    for _ in range(3000):
        if condition():
            return
        browser.page.wait_for_timeout(40)
    raise AssertionError("the condition never became true")


def reading(page: Any) -> str:
    return str(page.locator("#reading").inner_text())


def state(page: Any) -> tuple[bytes, bytes, tuple[str, ...]]:
    """Return what the two canvases show, and where the lines of the curves are."""
    lines = page.locator("svg .now").evaluate_all(
        "all => all.map((one) => one.getAttribute('transform'))"
    )
    return (
        picture(page, "picture").tobytes(),
        picture(page, "turning").tobytes(),
        tuple(lines),
    )


NAMELESS = """() => [...document.querySelectorAll("button, input, select, canvas, svg, section")]
  .filter((one) => !one.closest("[hidden], [aria-hidden=true]"))
  .filter((one) => !(one.getAttribute("aria-label") || one.getAttribute("aria-labelledby") ||
    one.closest("label")?.textContent.trim() || (one.tagName === "BUTTON" && one.textContent.trim())))
  .map((one) => one.outerHTML.slice(0, 80))"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "scheme"), [(320, "light"), (390, "dark"), (1280, "light")]
)
@pytest.mark.parametrize("which", ["doubtful", "filmed"])
def test_it_opens_without_errors_or_requests_and_everything_can_be_read(
    chromium: Any, request: pytest.FixtureRequest, which: str, width: int, scheme: str
) -> None:
    path = request.getfixturevalue(which)
    with opened(chromium, path, width, color_scheme=scheme) as browser:
        assert browser.page.evaluate("document.documentElement.scrollWidth") <= width
        for canvas in ("picture", "turning"):
            waited(
                browser,
                lambda name=canvas: (
                    (picture(browser.page, name)[..., 3] > 0).mean() > 0.02
                ),
            )
        for select in ("figure", "joint"):
            for option in browser.page.locator(f"#{select} option").evaluate_all(
                "all => all.map((one) => one.value)"
            ):
                browser.page.locator(f"#{select}").select_option(value=option)
                assert browser.page.locator(f"#{select}-chart svg path").count() >= 1
        browser.page.locator("summary").click()
        assert browser.page.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.page.evaluate(NAMELESS) == []
        assert browser.complaints == []
        assert [url for url in browser.requests if not url.startswith("data:")] == [
            path.as_uri()
        ]


def test_the_slider_moves_picture_body_and_curves_together(
    chromium: Any, doubtful: Path
) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page
        before = state(page)
        assert len(before[2]) == 3
        page.locator("#frame").fill("7")
        waited(
            browser,
            lambda: all(
                new != old for new, old in zip(state(page), before, strict=True)
            ),
        )
        assert len(set(state(page)[2])) == 1
        assert reading(page).startswith(
            f"frame 7 of {FRAMES}, 0.23 s; MPJPE 0 mm; IoU 1.000; cost 0.00"
        )
        assert page.locator("#frame").get_attribute("aria-valuetext") == reading(page)
        assert (
            page.locator("#turning").get_attribute("aria-label").endswith(reading(page))
        )


def test_keys_go_from_frame_to_frame_and_to_marked_frames(
    chromium: Any, doubtful: Path
) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page

        def after(*keys: str) -> int:
            for key in keys:
                page.keyboard.press(key)
            return int(reading(page).split()[1])

        assert [after("ArrowRight"), after("ArrowRight"), after("ArrowLeft")] == [
            1,
            2,
            1,
        ]
        assert [
            after("End"),
            after("ArrowRight"),
            after("Home"),
            after("ArrowLeft"),
        ] == [11, 11, 0, 0]
        assert [after("Shift+ArrowRight"), after("Home")] == [10, 0]
        assert [after("n") for _ in range(5)] == [HELD, 2, 3, LOST, HELD]
        assert after("p") == LOST
        page.keyboard.press(" ")
        assert page.locator("#play").inner_text() == "Pause"
        page.keyboard.press(" ")
        page.locator("#frame").focus()
        assert [after("Home"), after("ArrowRight")] == [0, 1]
        page.locator("#figure").focus()
        assert after("ArrowDown") == 1  # a list's keys are its own
        page.locator("#with-body").focus()
        page.keyboard.press(" ")
        assert not page.locator("#with-body").is_checked()
        assert page.locator("#play").inner_text() == "Play"


def test_the_body_is_where_the_camera_sees_it(chromium: Any, doubtful: Path) -> None:
    camera = 1
    scene = walk(FRAMES, [45.0, 135.0])
    with opened(chromium, doubtful) as browser:
        page = browser.page
        page.locator("#cameras button").nth(camera).click()
        for box in ("close-up", "with-mask"):
            page.locator(f"#{box}").uncheck()
        page.locator("#frame").fill("8")
        assert (
            page.locator("#picture")
            .get_attribute("aria-label")
            .startswith(f"Camera {camera + 1} with the body on")
        )
        drawn = (
            cv2.resize((picture(page, "picture")[..., 3] > 100).astype(np.uint8), SIZE)
            > 0
        )
        page.locator("#with-body").uncheck()
        page.locator("#with-mask").check()
        waited(browser, lambda: (picture(page, "picture")[..., 3] > 0).any())
        mask = (
            cv2.resize((picture(page, "picture")[..., 3] > 100).astype(np.uint8), SIZE)
            > 0
        )
    true = project(
        scene.body,
        scene.cameras[camera],
        scene.truth.poses[8],
        scene.truth.translations[8],
    )
    for shape in (drawn, mask):
        assert (shape & true).sum() / (shape | true).sum() > 0.95


def test_doubtful_frames_are_marked(chromium: Any, doubtful: Path) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page
        verdict = page.locator("#verdict").inner_text()
        assert (
            verdict
            == "Not determined: left and right unknown in 2 of 12, lost in 1 of 12 frames "
            "that show enough of the person."
        )
        assert (
            page.locator("#notes")
            .inner_text()
            .startswith("1 frame shows too little of the person")
        )
        assert page.locator("#marks li").all_inner_texts() == [
            "lost: 1 frame",
            "left and right unknown: 2 frames",
            "pose held: too little is visible: 1 frame",
        ]
        chart = page.locator("#sure-chart")
        assert [
            chart.locator(f".mark.{name}").count()
            for name in ("lost", "unknown", "held")
        ] == [1, 1, 1]
        assert chart.locator("polygon").count() == 3  # 50, 80 and 95 %
        wide = [
            chart.locator(f".mark.{name}").bounding_box()["width"]
            for name in ("lost", "unknown")
        ]
        assert wide[1] == pytest.approx(2 * wide[0], rel=0.05)
        page.locator("#frame").fill(str(LOST))
        assert reading(page).endswith("; lost")


def test_a_single_frame_has_no_player_and_no_curves(
    chromium: Any, tmp_path: Path
) -> None:
    scene = walk(1)
    with opened(
        chromium, viewed(tmp_path / "out", scene, exact_frames(scene)), 390
    ) as browser:
        assert browser.page.locator("#lead").inner_text().startswith("A single frame.")
        assert not browser.page.locator("#frame").is_visible()
        assert browser.page.locator("#curves").count() == 0
        browser.page.keyboard.press("n")
        assert reading(browser.page).startswith("frame 0 of 1, 0.00 s; MPJPE 0 mm")
        assert browser.complaints == []


def test_names_are_text_and_unreported_figures_are_hidden(
    chromium: Any, filmed: Path
) -> None:
    with opened(chromium, filmed) as browser:
        page = browser.page
        assert page.locator("#title").text_content() == EVIL
        assert page.locator("#notes").text_content().endswith(EVIL)
        verdict = page.locator("#verdict").inner_text()
        assert verdict.startswith("Trust: ")
        assert (
            "The method does not report which side is left or which frames are lost: frames without"
            in verdict
        )
        for hidden in ("#sure", "#doubtful", "#truth-label", "#cameras"):
            assert not page.locator(hidden).is_visible()
        assert "MPJPE" not in page.locator("body").inner_text()
        assert browser.complaints == []
