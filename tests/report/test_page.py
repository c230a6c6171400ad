"""The report in a real browser: it opens without errors, anyone can read it, and its controls work."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.report.repeat import repeat_command
from posefit.sweep.ledger import Ledger
from tests.cli.test_command_line import run
from tests.report.browser import EVIL, ledger, opened, result, sure
from tests.report.searched import cell, problems, search_result, searched
from tests.sweep.fake import cells

FIRST = replace(cells(1)[0], frames=4)
METHODS = 9  # more than there are colours


def written(made: Path) -> Path:
    """Return the page of a ledger."""
    out = made.with_name("report.html")
    done = run("report", made, "--out", out)
    assert done.exit_code == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page with every section: failures, gaps, warnings, uncertainty, a selector."""
    made = []
    modes = {0: [[8, 0.55, 0.5], [32, 0.98, 0.9]], 1: [[40, 0.7, 0.2]]}
    for m in range(METHODS):
        for i in range(9):
            for s in range(2):
                views = (0.0, 90.0) if i == 2 else (45.0,)
                more = {"warnings": ["the search met the border of its box"]} if (m, i) == (2, 3) else {}
                more |= sure(0.8, 60.0, modes[m], 0.25) if m in modes else {}
                one = replace(FIRST, method=f"method-{m}@pca", instance=i, seed=s, view_degrees=views)
                one = replace(one, corruption={"holes": 0.1 * (i % 2)})
                if (m, i) != (4, 7):
                    made.append(result(one, 1.0 + 0.3 * m + 0.1 * ((3 * m + i) % 5) + 0.05 * s, **more))
    lost = [(replace(FIRST, method="method-4@pca", instance=7, seed=s), ["ValueError: it had to"]) for s in range(2)]
    return written(ledger(tmp_path_factory.mktemp("tracks") / "results", made, lost))


@pytest.fixture(scope="module")
def searches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page of single searches by six methods, with a failure of a hostile name."""
    methods = {"cma": 14, "pso": 11, "sapso": 10, "annealed": 7, "scipy": 5, "random": 2}
    lost = [(cell(EVIL, settings={EVIL: EVIL}), [f"ValueError: {EVIL}"])]
    path = tmp_path_factory.mktemp("searches") / "results"
    return written(searched(path, methods, problems([1, 5], [9, 24], 3), lost))


def texts(page: Any, table: str, column: int) -> list[str]:
    """Return the texts of a column of a table, without the small print below."""
    found: list[str] = page.locator(f"{table} tbody tr td:nth-child({column})").all_inner_texts()
    return [text.split("\n")[0] for text in found]


BOXES = """id => [...document.querySelectorAll(`#${id} svg text`)].map((one) => {
  const [own, all] = [one, one.ownerSVGElement].map((node) => node.getBoundingClientRect());
  return [own.left, own.top, own.right, own.bottom, own.left < all.left - 1 || own.right > all.right + 1, one.textContent];
})"""


def labels_are_apart(page: Any, figure: str) -> None:
    found = page.evaluate(BOXES, figure)
    assert len(found) > 3
    for k, (left, top, right, bottom, outside, text) in enumerate(found):
        assert not outside, (figure, text)
        for other in found[:k]:
            apart = left >= other[2] or right <= other[0] or top >= other[3] - 2 or bottom <= other[1] + 2
            assert apart, (figure, text, other[5])


@pytest.mark.slow
@pytest.mark.parametrize("width", [320, 390, 1280, 1920])
def test_it_opens_without_errors_and_requests_and_everyone_can_read_it(
    chromium: Any, page: Path, searches: Path, width: int
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install posefit[browser]")
    figures = {
        page: ("standing", "convergence", "ecdf", "difference", "joint-errors"),
        searches: ("standing", "chart-0"),
    }
    for path, names in figures.items():
        for scheme in ("light", "dark"):
            with opened(chromium, path, width, color_scheme=scheme, bypass_csp=True) as seen:
                assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
                seen.page.locator("#all").click()
                for name in names:
                    labels_are_apart(seen.page, name)
                violations = axe.Axe().run(seen.page).response["violations"]
                assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in violations] == []
                assert seen.requests == [path.as_uri()]
                assert seen.complaints == []


def test_the_first_screen_has_the_leader_the_figure_three_tracks_and_failures(chromium: Any, page: Path) -> None:
    with opened(chromium, page, reduced_motion="reduce") as seen:
        assert seen.page.inner_text("#headline").startswith("method-0@pca leads with an error of")
        for part in ("#headline", "#trouble", "#standing", "#three"):
            assert seen.page.locator(part).bounding_box()["y"] < 900, part
        assert seen.page.locator("#standing .mark").count() == METHODS
        assert seen.page.locator("#standing .baseline").count() == 3
        names = [text.split(" track")[0] for text in seen.page.locator("#three strong").all_inner_texts()]
        assert names == ["best", "median", "worst"]
        for text in ("2 × ValueError: it had to", "instance 7: no run of method-4@pca", "2 runs with a warning"):
            assert text in seen.page.inner_text("#trouble")
        assert seen.page.inner_text("#moving") == "Play"  # who wants less motion has none
        links = seen.page.locator("#sections a").all_inner_texts()
        assert links == ["Leaderboard", "Comparison", "Who wins where", "Curves", "Joints", "Uncertainty", "Gallery",
                         "One method against all others", "All runs", "Failures"]  # fmt: skip
        seen.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        seen.page.emulate_media(media="print")
        for part in ("#headline", "#standing svg", "#facts", "#trouble", "#leaders table", "#selection-text"):
            assert seen.page.locator(part).is_visible(), part
        for part in ("#moving", "nav", "#rows"):
            assert seen.page.locator(part).is_hidden(), part
        assert seen.complaints == []


def test_tables_sort_and_compare_and_mark_warnings(chromium: Any, page: Path) -> None:
    with opened(chromium, page) as seen:
        heads = seen.page.locator("#leaders th")
        assert heads.nth(1).get_attribute("aria-sort") == "ascending"
        errors = [float(text) for text in texts(seen.page, "#leaders", 2)]
        assert errors == sorted(errors)
        assert len(errors) == METHODS + 3  # and baselines
        heads.nth(1).locator("button").focus()
        seen.page.keyboard.press("Enter")
        assert [float(text) for text in texts(seen.page, "#leaders", 2)] == errors[::-1]
        for k in range(heads.count()):
            heads.nth(k).locator("button").click()
            assert heads.nth(k).get_attribute("aria-sort") in ("ascending", "descending")
        seen.page.locator("#of-method").select_option(label="method-2@pca")
        warned = seen.page.locator("#all-rows [role=img]")
        assert warned.count() == 2
        assert warned.first.get_attribute("aria-label") == "warning: the search met the border of its box"
        seen.page.locator("#against").select_option(label="method-3@pca")
        assert texts(seen.page, "#pairs", 7).count("better") == METHODS - 4
        seen.page.locator("#mine").select_option(label="method-8@pca")
        assert all(re.fullmatch(r"[1-9] of [89]", text) for text in texts(seen.page, "#duels", 4))
        assert seen.page.inner_text("#verdict").startswith("method-8@pca (default settings; 2,440 evaluations")
        assert "None of its runs lost a frame" in seen.page.inner_text("#tracks")
        assert seen.complaints == []


def test_buttons_show_and_hide_methods_and_their_intervals_in_every_chart(chromium: Any, page: Path) -> None:
    charts = ("convergence", "ecdf", "joint-errors", "reliability", "coverage")
    with opened(chromium, page) as seen:

        def counts() -> list[int]:
            return [seen.page.locator(f"#{chart} [data-method='0']").count() for chart in charts]

        button = seen.page.locator("#toggles button[data-method='0']")
        assert seen.page.locator("#toggles button[aria-pressed=true]").count() == 4
        assert counts() == [1, 1, 27, 1, 1]
        marks = seen.page.locator("#toggles .mark")
        shape = "one => one.getAttribute('style') + one.getAttribute('points')"
        assert len({marks.nth(k).evaluate(shape) for k in range(METHODS)}) == METHODS
        title = " ".join(seen.page.locator("#reliability title").first.text_content().split())
        assert title == "method-0@pca: 55 % predicted, 50 % right, of 128 frames"
        assert seen.page.locator("#sure tbody tr").count() == 2
        band = seen.page.locator("#convergence [data-method='0'] .band")
        opacity = "one => Number(getComputedStyle(one).opacity)"
        assert band.evaluate(opacity) == 0.0
        button.hover()
        assert band.evaluate(opacity) > 0.1
        seen.page.locator("h1").hover()
        seen.page.locator("#bands").check()
        assert band.evaluate(opacity) > 0.1
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        assert counts() == [0, 0, 0, 0, 0]
        seen.page.locator("#none").click()
        assert seen.page.locator("#ecdf path").count() == 0
        seen.page.locator("#all").click()
        assert seen.page.locator("#ecdf .curve").count() == METHODS
        assert seen.complaints == []


@pytest.mark.slow
def test_the_gallery_plays_and_the_skeleton_turns(chromium: Any, page: Path) -> None:
    with opened(chromium, page, 390, has_touch=True) as seen:
        seen.page.locator(".card", has_text="view 0°, 90°").first.click()
        assert "view 0°, 90°" in seen.page.inner_text("#viewer-title")

        def changes(canvas: str, act: Callable[[], Any]) -> bool:
            picture = "id => document.getElementById(id).toDataURL()"
            before = seen.page.evaluate(picture, canvas)
            act()
            return bool(seen.page.evaluate(picture, canvas) != before)

        seen.page.locator("#turning").scroll_into_view_if_needed()
        box = seen.page.locator("#turning").bounding_box()

        def drag() -> None:
            seen.page.mouse.move(box["x"] + 50, box["y"] + 50)
            seen.page.mouse.down()
            seen.page.mouse.move(box["x"] + 120, box["y"] + 80, steps=3)
            seen.page.mouse.up()

        assert changes("turning", drag)
        seen.page.locator("#turning").focus()
        assert changes("turning", lambda: seen.page.keyboard.press("ArrowLeft"))
        assert changes("turning", lambda: seen.page.keyboard.press("+"))
        assert changes("overlay", lambda: seen.page.locator("#frame").fill("3"))
        assert "frame 3: MPJPE" in seen.page.inner_text("#reading")
        assert changes("overlay", lambda: seen.page.locator("#viewer-camera").select_option(index=1))
        seen.page.locator("#viewer-method").select_option(label="method-5@pca")
        seen.page.locator("#play").click()
        seen.page.locator("#reading", has_text="frame 1:").wait_for(timeout=60_000)
        seen.page.locator("#play").click()
        assert seen.page.inner_text("#play") == "Play"
        assert seen.complaints == []


def test_hostile_names_are_text_and_commands_repeat_their_rows(chromium: Any, tmp_path: Path) -> None:
    named = [replace(FIRST, method=EVIL, motion=EVIL, settings={EVIL: EVIL}, seed=seed) for seed in (0, 2**60)]
    plain = [replace(FIRST, motion=EVIL, seed=seed) for seed in (0, 2**60)]
    rows = [result(one, 1.0 + k) for k, one in enumerate([*named, *plain])]
    lost = [(replace(FIRST, method=EVIL, seed=7), [f"ValueError: {EVIL}"])]
    made = ledger(tmp_path / "results", rows, lost)
    with opened(chromium, written(made)) as seen:
        for part in ("#facts", "#lost"):
            assert EVIL in seen.page.locator(part).text_content()
        assert seen.page.locator("img").count() == 0
        assert seen.page.locator("script").count() == 2
        assert seen.page.locator("#certainty, #sections a[href='#certainty']").count() == 0
        seen.page.locator(".card").first.click()
        assert seen.page.locator("#overlay").is_hidden()  # there is no such motion, and no camera
        seen.page.keyboard.press("Escape")
        commands = set()
        buttons = seen.page.locator("#all-rows button", has_text="command")
        for k in range(buttons.count()):
            buttons.nth(k).click()
            commands.add(seen.page.locator("#command").text_content())
            seen.page.locator("#again .close").click()
        assert commands == {repeat_command(row["spec"]) for row in Ledger(made).rows()}
        buttons.nth(0).click()
        seen.page.locator("#copy").click()
        seen.page.get_by_text("copied").wait_for()
        assert seen.complaints == []
        assert len(seen.requests) == 1


def test_single_searches_have_curves_and_running_times(chromium: Any, searches: Path) -> None:
    with opened(chromium, searches) as seen:
        assert seen.page.inner_text("#headline").startswith("cma leads with 51.7 % of all targets reached")
        for part in ("#headline", "#trouble", "#standing"):
            box = seen.page.locator(part).bounding_box()
            assert box["y"] + box["height"] < 900, part
        assert seen.page.locator("#standing .mark").count() == 6
        assert seen.page.locator("#standing .baseline").count() == 1
        assert EVIL in seen.page.locator("#trouble").text_content()
        assert seen.page.locator("#charts figure").count() == 3  # all functions, and each of two
        assert seen.page.locator("#charts .curve").count() == 4 * 3
        seen.page.locator("#all").click()
        assert seen.page.locator("#charts .curve").count() == 6 * 3
        rows = seen.page.locator("#ert tbody tr")
        assert rows.count() == 6 * 2 * 3
        seen.page.locator("#of-function").select_option(label="5 mismatched body")
        seen.page.locator("#of-dimension").select_option(label="24")
        assert rows.count() == 6
        assert "cma" in rows.first.inner_text()
        assert rows.first.locator("strong").count() == 2  # to 16 and to 4 above, as soon as others
        assert "–" in rows.last.inner_text()
        seen.page.locator("#lost button").last.click()
        assert 'suite = "posefit-2026.1"' in seen.page.inner_text("#command")
        assert seen.complaints == []


def test_pages_of_one_run_or_of_failures_alone_open(chromium: Any, tmp_path: Path) -> None:
    search = cell("cma")
    one = written(ledger(tmp_path / "one" / "results", [search_result(search, 5)]))
    with opened(chromium, one) as seen:
        note = seen.page.inner_text("#standing-note")
        assert "there are no intervals" in note
        assert "no baseline, for the plan has no random search" in note
        assert seen.complaints == []
    for k, (lost, name) in enumerate(((replace(FIRST, seed=7), "random@pca on walk"), (search, "cma on f1 in 9D"))):
        failed = ledger(tmp_path / str(k) / "results", [], [(lost, ["its process died of SIGSEGV"])])
        with opened(chromium, written(failed), 390) as seen:
            assert seen.page.inner_text("#headline") == "Every cell failed."
            assert "its process died of SIGSEGV" in seen.page.inner_text("#trouble")
            assert name in seen.page.inner_text("#failures")
            assert seen.page.locator("#sections a").all_inner_texts() == ["Failures"]
            assert seen.complaints == []
