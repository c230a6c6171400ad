"""The viewer of a track in a real browser: it opens without a complaint, and video, body and curves move together."""

import base64
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.silhouette.cost import project
from tests.report.browser import EVIL, Watched, opened
from tests.tracking.scenes import SIZE, exact_frames, uncertain_frames, viewed, walk

FRAMES = 12
MIRRORED = [0.0, 0.0, 0.3, 0.4, 0.15, *[0.0] * 7]
LOST, HELD = 5, 1


@pytest.fixture(scope="module")
def doubtful(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the viewer of a track in two cameras, of which one frame is held, two may be mirrored, and one is lost."""
    scene = walk(FRAMES, [45.0, 135.0])
    observations = list(scene.observations)
    observations[HELD] = replace(observations[HELD], usable=False)
    frames = [
        replace(frame, lost=0.9 if k == LOST else 0.1) for k, frame in enumerate(uncertain_frames(scene, MIRRORED))
    ]
    return viewed(tmp_path_factory.mktemp("doubtful") / "out", replace(scene, observations=observations), frames)


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the viewer of a filmed track whose truth is unknown, and which has a hostile name."""
    scene = walk(FRAMES)
    pictures = [np.full((SIZE[1], SIZE[0], 3), (20 * k, 200, 40), np.uint8) for k in range(FRAMES)]
    unknown = replace(scene, truth=None, name=EVIL, warnings=[EVIL], pictures=lambda: iter(pictures))
    return viewed(tmp_path_factory.mktemp("filmed") / "out", unknown, exact_frames(scene))


def picture(page: Any, canvas: str) -> Any:
    """Return what a canvas shows, (height, width, 4)."""
    text = page.evaluate("id => document.getElementById(id).toDataURL()", canvas).partition(",")[2]
    return cv2.imdecode(np.frombuffer(base64.b64decode(text), np.uint8), cv2.IMREAD_UNCHANGED)


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
    lines = page.locator("svg .now").evaluate_all("all => all.map((one) => one.getAttribute('transform'))")
    return picture(page, "picture").tobytes(), picture(page, "turning").tobytes(), tuple(lines)


NAMELESS = """() => [...document.querySelectorAll("button, input, select, canvas, svg, section")]
  .filter((one) => !one.closest("[hidden], [aria-hidden=true]"))
  .filter((one) => !(one.getAttribute("aria-label") || one.getAttribute("aria-labelledby") ||
    one.closest("label")?.textContent.trim() || (one.tagName === "BUTTON" && one.textContent.trim())))
  .map((one) => one.outerHTML.slice(0, 80))"""


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), [(320, "light"), (390, "dark"), (1280, "light")])
@pytest.mark.parametrize("which", ["doubtful", "filmed"])
def test_it_opens_without_errors_or_requests_and_everything_can_be_read(
    chromium: Any, request: pytest.FixtureRequest, which: str, width: int, scheme: str
) -> None:
    path = request.getfixturevalue(which)
    with opened(chromium, path, width, color_scheme=scheme) as browser:
        assert browser.page.evaluate("document.documentElement.scrollWidth") <= width
        for canvas in ("picture", "turning"):
            waited(browser, lambda name=canvas: (picture(browser.page, name)[..., 3] > 0).mean() > 0.02)
        for select in ("figure", "joint"):
            for option in browser.page.locator(f"#{select} option").evaluate_all("all => all.map((one) => one.value)"):
                browser.page.locator(f"#{select}").select_option(value=option)
                assert browser.page.locator(f"#{select}-chart svg path").count() >= 1
        browser.page.locator("summary").click()
        assert browser.page.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.page.evaluate(NAMELESS) == []
        assert browser.complaints == []
        assert [url for url in browser.requests if not url.startswith("data:")] == [path.as_uri()]


def test_the_slider_moves_picture_body_and_curves_together(chromium: Any, doubtful: Path) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page
        before = state(page)
        assert len(before[2]) == 3
        page.locator("#frame").fill("7")
        waited(browser, lambda: all(new != old for new, old in zip(state(page), before, strict=True)))
        assert len(set(state(page)[2])) == 1
        assert reading(page).startswith(f"frame 7 of {FRAMES}, 0.23 s; MPJPE 0 mm; IoU 1.000; cost 0.00")
        assert page.locator("#frame").get_attribute("aria-valuetext") == reading(page)
        assert page.locator("#turning").get_attribute("aria-label").endswith(reading(page))


def test_keys_go_from_frame_to_frame_and_to_marked_frames(chromium: Any, doubtful: Path) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page

        def after(*keys: str) -> int:
            for key in keys:
                page.keyboard.press(key)
            return int(reading(page).split()[1])

        assert [after("ArrowRight"), after("ArrowRight"), after("ArrowLeft")] == [1, 2, 1]
        assert [after("End"), after("ArrowRight"), after("Home"), after("ArrowLeft")] == [11, 11, 0, 0]
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
    camera, scene = 1, walk(FRAMES, [45.0, 135.0])
    with opened(chromium, doubtful) as browser:
        page = browser.page
        page.locator("#cameras button").nth(camera).click()
        for box in ("close-up", "with-mask"):
            page.locator(f"#{box}").uncheck()
        page.locator("#frame").fill("8")
        assert page.locator("#picture").get_attribute("aria-label").startswith(f"Camera {camera + 1} with the body on")
        drawn = cv2.resize((picture(page, "picture")[..., 3] > 100).astype(np.uint8), SIZE) > 0
        page.locator("#with-body").uncheck()
        page.locator("#with-mask").check()
        waited(browser, lambda: (picture(page, "picture")[..., 3] > 0).any())
        mask = cv2.resize((picture(page, "picture")[..., 3] > 100).astype(np.uint8), SIZE) > 0
    true = project(scene.body, scene.cameras[camera], scene.truth.poses[8], scene.truth.translations[8])
    for shape in (drawn, mask):
        assert (shape & true).sum() / (shape | true).sum() > 0.95


def test_doubtful_frames_are_marked(chromium: Any, doubtful: Path) -> None:
    with opened(chromium, doubtful) as browser:
        page = browser.page
        verdict = page.locator("#verdict").inner_text()
        assert verdict == "Not determined: left and right: unknown in 2 of 12 frames; 1 frame lost."
        assert page.locator("#notes").inner_text().startswith("1 frame shows too little of the person")
        assert page.locator("#marks li").all_inner_texts() == [
            "lost: 1 frame",
            "left and right unknown: 2 frames",
            "pose held: too little is visible: 1 frame",
        ]
        chart = page.locator("#sure-chart")
        assert [chart.locator(f".mark.{name}").count() for name in ("lost", "unknown", "held")] == [1, 1, 1]
        assert chart.locator("polygon").count() == 3  # 50, 80 and 95 %
        wide = [chart.locator(f".mark.{name}").bounding_box()["width"] for name in ("lost", "unknown")]
        assert wide[1] == pytest.approx(2 * wide[0], rel=0.05)
        page.locator("#frame").fill(str(LOST))
        assert reading(page).endswith("; lost")


def test_a_single_frame_has_no_player_and_no_curves(chromium: Any, tmp_path: Path) -> None:
    scene = walk(1)
    with opened(chromium, viewed(tmp_path / "out", scene, exact_frames(scene)), 390) as browser:
        assert browser.page.locator("#lead").inner_text().startswith("A single frame.")
        assert not browser.page.locator("#frame").is_visible()
        assert browser.page.locator("#curves").count() == 0
        browser.page.keyboard.press("n")
        assert reading(browser.page).startswith("frame 0 of 1, 0.00 s; MPJPE 0 mm")
        assert browser.complaints == []


def test_names_are_text_and_unreported_figures_are_hidden(chromium: Any, filmed: Path) -> None:
    with opened(chromium, filmed) as browser:
        page = browser.page
        assert page.locator("#title").text_content() == EVIL
        assert page.locator("#notes").text_content().endswith(EVIL)
        verdict = page.locator("#verdict").inner_text()
        assert verdict.startswith("Trust: ")
        assert "The method does not report which side is left or which frames are lost: frames without" in verdict
        for hidden in ("#sure", "#doubtful", "#truth-label", "#cameras"):
            assert not page.locator(hidden).is_visible()
        assert "MPJPE" not in page.locator("body").inner_text()
        assert browser.complaints == []
