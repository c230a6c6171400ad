"""The page of single searches in a real browser: it opens without a complaint, and everybody can read it."""

from pathlib import Path
from typing import Any

import pytest

from tests.cli.test_command_line import run
from tests.report.browser import EVIL, ledger, opened
from tests.report.search.searched import cell, found, problems, searched


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page of six methods, with a failure of a hostile name."""
    folder = tmp_path_factory.mktemp("searches")
    methods = {"cma": 14, "pso": 11, "sapso": 10, "annealed": 7, "scipy": 5, "random": 2}
    lost = [(cell(EVIL, settings={EVIL: EVIL}), [f"ValueError: {EVIL}"])]
    made = searched(folder / "results", methods, problems([1, 5], [9, 24], 3), lost)
    assert run("report", made, "--out", folder / "page.html").exit_code == 0
    return folder / "page.html"


@pytest.mark.parametrize("width", [320, 390, 1280, 1920])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_opens_without_a_complaint_and_axe_finds_nothing(chromium: Any, page: Path, width: int, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install posefit[browser]")
    with opened(chromium, page, width, color_scheme=scheme, bypass_csp=True) as seen:
        assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
        assert seen.requests == [page.as_uri()]
        found_by_axe = axe.Axe().run(seen.page).response["violations"]
        assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found_by_axe] == []
        assert seen.complaints == []


def test_the_first_screen_answers_with_what_failed_and_the_figure(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        assert seen.page.inner_text("#answer").startswith("cma leads with 51.7 % of all targets reached")
        for part in ("#answer", "#trouble", "#standing"):
            box = seen.page.locator(part).bounding_box()
            assert box["y"] + box["height"] < 900, part
        assert seen.page.locator("#standing .mark").count() == 6
        assert seen.page.locator("#standing .baseline").count() == 1
        assert EVIL in seen.page.locator("#trouble").text_content()
        assert EVIL in seen.page.locator("#lost").text_content()


def test_four_methods_are_drawn_at_first_in_a_chart_of_all_functions_and_one_of_each(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        assert seen.page.locator("#together svg .curve").count() == 4
        assert seen.page.locator("#each figure").count() == 2
        seen.page.locator("#all").click()
        assert seen.page.locator("#together svg .curve").count() == 6
        assert seen.page.locator("#each svg .curve").count() == 12
        assert seen.complaints == []


def test_running_times_are_shown_of_a_function_and_a_dimension_and_the_least_is_bold(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        rows = seen.page.locator("#ert tbody tr")
        assert rows.count() == 6 * 2 * 3
        seen.page.locator("#of-function").select_option(label="5 mismatched body")
        seen.page.locator("#of-dimension").select_option(label="24")
        assert rows.count() == 6
        assert "cma" in rows.first.inner_text()
        assert rows.first.locator("strong").count() == 2  # to 16 and to 4 above, as soon as others
        assert "–" in rows.last.inner_text()


def test_the_command_of_a_cell_that_failed_is_there(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        seen.page.locator("#lost button").last.click()
        assert 'suite = "posefit-2026.1"' in seen.page.inner_text("#command")
        seen.page.locator("#again .close").click()
        assert not seen.page.locator("#again").is_visible()


def test_where_there_is_no_random_search_and_one_instance_the_figure_says_so(chromium: Any, tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [found(cell("cma"), 5)])
    assert run("report", made, "--out", tmp_path / "page.html").exit_code == 0
    with opened(chromium, tmp_path / "page.html") as seen:
        said = seen.page.inner_text("#standing-note")
        assert "there are no intervals" in said
        assert "no baseline, for the plan has no random search" in said
        assert seen.page.locator("#each").count() == 0
        assert seen.complaints == []


def test_where_every_search_failed_the_page_says_so(chromium: Any, tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [], [(cell("cma"), ["ValueError: no"])])  # type: ignore[list-item]
    assert run("report", made, "--out", tmp_path / "page.html").exit_code == 0
    with opened(chromium, tmp_path / "page.html", 390) as seen:
        assert seen.page.inner_text("#answer") == "Every cell failed."
        assert "ValueError: no" in seen.page.inner_text("#trouble")
        assert seen.page.locator("#sections a").all_inner_texts() == ["Failures"]
        assert seen.complaints == []
