"""Everybody can read the report: contrast in light and dark, what axe-core finds, marks beside colours, no motion."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.page.document import part
from posefit.report.colours import DARK, LIGHT
from tests.cli.test_command_line import run
from tests.report.browser import ledger, opened, result, sure
from tests.sweep.fake import cells

FIRST = replace(cells(1)[0], frames=4)
LEAST = 4.5  # WCAG 2.2, 1.4.3, of text; we ask it of marks and lines, too


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2, of a colour such as #fff or #0063a6."""
    digits = colour.removeprefix("#")
    pairs = [one * 2 for one in digits] if len(digits) == 3 else [digits[k : k + 2] for k in (0, 2, 4)]
    parts = [int(one, 16) / 255.0 for one in pairs]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def ratio(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def test_contrast_is_that_of_wcag() -> None:
    assert ratio("#fff", "#000000") == pytest.approx(21.0)
    assert ratio("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)  # the well-known grey that just fails


@pytest.mark.parametrize(("scheme", "colours"), [(0, LIGHT), (1, DARK)], ids=["light", "dark"])
def test_colours_stand_out_from_what_is_behind_them(scheme: int, colours: dict[str, str]) -> None:
    schemes = re.findall(r":root \{([^}]*--card[^}]*)\}", part("posefit.page", "base.css"))
    base = dict(re.findall(r"--(\w+): (#\w+)", schemes[scheme]))
    shown = {**colours, **{name: base[name] for name in ("ink", "soft", "accent", "bad")}}
    for name, colour in shown.items():
        if colour.startswith("#"):
            assert min(ratio(colour, base[behind]) for behind in ("back", "card")) >= LEAST, (name, colour)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page that has everything: failures, gaps, warnings, certainty, a selector, more methods than colours."""
    folder = tmp_path_factory.mktemp("access")
    made = []
    for m in range(9):
        for i in range(8):
            for s in range(2):
                cell = replace(FIRST, method=f"method-{m}@pca", instance=i, seed=s, corruption={"holes": 0.1 * (i % 2)})
                more = {"warnings": ["the search met the border of its box"]} if (m, i) == (2, 3) else {}
                more |= sure(0.8, 60.0, [[40, 0.7, 0.6]]) if m < 3 else {}
                if (m, i) != (4, 7):
                    made.append(result(cell, 1.0 + 0.3 * m + 0.1 * ((3 * m + i) % 5) + 0.05 * s, **more))
    lost = [(replace(FIRST, method="method-4@pca", instance=7, seed=s), ["ValueError: it had to"]) for s in range(2)]
    assert run("report", ledger(folder / "results", made, lost), "--out", folder / "report.html").exit_code == 0
    return folder / "report.html"


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(chromium: Any, page: Path, width: int, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install posefit[browser]")
    with opened(chromium, page, width, color_scheme=scheme, bypass_csp=True) as seen:
        found = axe.Axe().run(seen.page)
        assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found.response["violations"]] == []


def test_the_first_screen_has_the_answer_the_figure_and_three_tracks_and_what_failed(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        assert seen.page.inner_text("#answer").startswith("method-0@pca leads with an error of 1.16°")
        for part_of in ("#answer", "#trouble", "#standing", "#three"):
            box = seen.page.locator(part_of).bounding_box()
            assert box["y"] < 900, part_of
        assert seen.page.locator("#standing .mark").count() == 9
        assert seen.page.locator("#standing .baseline").count() == 3
        assert [text.split(" track")[0] for text in seen.page.locator("#three strong").all_inner_texts()] == [
            "best", "median", "worst",
        ]  # fmt: skip
        said = seen.page.inner_text("#trouble")
        assert "2 × ValueError: it had to" in said
        assert "instance 7: no run of method-4@pca" in said
        assert "2 runs with a warning" in said
        assert seen.complaints == []


def test_rows_with_warnings_are_marked(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        seen.page.locator("#of-method").select_option(label="method-2@pca")
        marked = seen.page.locator("#all-rows [role=img]")
        assert marked.count() == 2
        assert marked.first.get_attribute("aria-label") == "warning: the search met the border of its box"


def test_no_two_methods_look_alike(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        marks = seen.page.locator("#toggles .mark")
        assert marks.count() == 9
        shape = """one => {
          const box = one.getBBox();
          const points = one.getAttribute("points").split(" ").map((pair) => pair.split(","));
          return JSON.stringify([one.getAttribute("style"), points.length, Math.round(box.height * 10), points[0][0]]);
        }"""
        assert len({marks.nth(k).evaluate(shape) for k in range(9)}) == 9


@pytest.mark.parametrize("width", [320, 390, 1280, 1920])
def test_labels_of_figures_do_not_touch(chromium: Any, page: Path, width: int) -> None:
    boxes = """id => [...document.querySelectorAll(`#${id} svg text`)].map((one) => {
      const box = one.getBoundingClientRect();
      return [box.left, box.top, box.right, box.bottom, one.textContent];
    })"""
    with opened(chromium, page, width) as seen:
        seen.page.locator("#all").click()
        for figure in ("standing", "convergence", "ecdf", "difference", "joint-errors"):
            found = seen.page.evaluate(boxes, figure)
            assert len(found) > 3
            for k, (left, top, right, bottom, text) in enumerate(found):
                for other in found[:k]:
                    apart = left >= other[2] or right <= other[0] or top >= other[3] - 2 or bottom <= other[1] + 2
                    assert apart, (figure, text, other[4])


def test_whoever_wants_no_motion_has_none_and_others_can_stop_it(chromium: Any, page: Path) -> None:
    with opened(chromium, page, reduced_motion="reduce") as seen:
        assert seen.page.inner_text("#moving") == "Play"
    with opened(chromium, page) as seen:
        assert seen.page.inner_text("#moving") == "Pause"
        seen.page.locator("#moving").click()
        assert seen.page.inner_text("#moving") == "Play"


def test_on_paper_the_answer_and_what_was_run_are_there(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        seen.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        seen.page.emulate_media(media="print")
        for part_of in ("#answer", "#standing svg", "#facts", "#trouble", "#leaders table", "#selection-said"):
            assert seen.page.locator(part_of).is_visible(), part_of
        for part_of in ("#moving", "nav"):
            assert seen.page.locator(part_of).is_hidden(), part_of


def test_intervals_show_where_a_curve_is_pointed_at_or_all_are_asked_for(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        band = seen.page.locator("#convergence [data-method='0'] .band")
        shown_as = "one => Number(getComputedStyle(one).opacity)"
        assert band.evaluate(shown_as) == 0.0
        seen.page.locator("#toggles button[data-method='0']").hover()
        assert band.evaluate(shown_as) > 0.1
        seen.page.locator("h1").hover()
        assert band.evaluate(shown_as) == 0.0
        seen.page.locator("#bands").check()
        assert band.evaluate(shown_as) > 0.1
