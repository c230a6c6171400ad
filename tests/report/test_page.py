"""The report in a real browser: it loads without a complaint, and what it promises works."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.report.repeat import repeat_command
from posefit.sweep.ledger import Ledger
from tests.cli.test_command_line import run
from tests.report.browser import EVIL, ledger, opened, result, sure
from tests.sweep.fake import cells

PLAN = """
[defaults]
frames = 6
size = [80, 60]
evaluations = 80
settings.full.limits = "training"

[product]
methods = ["sapso@pca", "sapso@full", "particle@full", "random@pca"]
motions = ["walk", { motion = "run", view_degrees = [0, 90] }]
seeds = 3
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    (folder / "plan.toml").write_text(PLAN)
    done = run("sweep", folder / "plan.toml", "--out", folder / "results", "--workers", 2)
    assert done.exit_code == 0, done.stderr
    written = run("report", folder / "results", "--out", folder / "report.html")
    assert written.exit_code == 0, written.stderr
    return folder


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    first = replace(cells(1)[0], frames=4)
    named = [replace(first, method=EVIL, motion=EVIL, settings={EVIL: EVIL}, seed=seed) for seed in (0, 2**60)]
    plain = [replace(first, motion=EVIL, seed=seed) for seed in (0, 2**60)]
    found = [result(cell, 1.0 + k) for k, cell in enumerate([*named, *plain])]
    lost = replace(first, method=EVIL, seed=7)
    made = ledger(folder / "results", found, [(lost, [f"ValueError: {EVIL}"])])
    assert run("report", made, "--out", folder / "report.html").exit_code == 0
    return folder / "report.html"


def shown(page: Any, table: str, column: int) -> list[str]:
    """Return the texts of a column of a table, without what stands small below."""
    texts: list[str] = page.locator(f"{table} tbody tr td:nth-child({column})").all_inner_texts()
    return [text.split("\n")[0] for text in texts]


@pytest.mark.parametrize("width", [320, 390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_loads_without_a_complaint_and_asks_for_nothing_else(
    chromium: Any, swept: Path, width: int, scheme: str
) -> None:
    with opened(chromium, swept / "report.html", width, color_scheme=scheme) as seen:
        assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
        for section in ("leaders", "difference", "pairs", "convergence", "ecdf", "joint-errors", "cards", "all-rows"):
            assert seen.page.locator(f"#{section} > *").count() > 0, section
        seen.page.locator(".card").first.click()
        seen.page.keyboard.press("Escape")
        assert seen.complaints == []
        assert seen.requests == [(swept / "report.html").as_uri()]


def test_every_column_of_the_leaderboard_sorts_by_mouse_and_keyboard(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        heads = seen.page.locator("#leaders th")
        assert heads.nth(1).get_attribute("aria-sort") == "ascending"
        errors = [float(text) for text in shown(seen.page, "#leaders", 2)]
        assert errors == sorted(errors)
        assert len(errors) == 4 + 3  # methods and baselines
        heads.nth(1).locator("button").focus()
        seen.page.keyboard.press("Enter")
        assert heads.nth(1).get_attribute("aria-sort") == "descending"
        assert [float(text) for text in shown(seen.page, "#leaders", 2)] == errors[::-1]
        for k in range(heads.count()):
            heads.nth(k).locator("button").click()
            assert heads.nth(k).get_attribute("aria-sort") in ("ascending", "descending")
        assert seen.page.locator("#leaders th[aria-sort=none]").count() == heads.count() - 1


def test_toggles_show_and_hide_methods_in_every_chart(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        page = seen.page

        def drawn() -> list[int]:
            return [
                page.locator(f"#{chart} [data-method='0']").count() for chart in ("convergence", "ecdf", "joint-errors")
            ]

        button = page.locator("#toggles button[data-method='0']")
        assert button.get_attribute("aria-pressed") == "true"
        assert page.locator("#toggles button[aria-pressed=true]").count() == 4
        assert drawn() == [1, 1, 27]
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        assert drawn() == [0, 0, 0]
        page.locator("#all").click()
        assert drawn() == [1, 1, 27]
        page.locator("#none").click()
        assert page.locator("#ecdf path").count() == 0
        page.locator("#all").click()
        page.locator("#bands").check()
        assert seen.complaints == []


def test_the_gallery_plays_and_the_skeleton_turns(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html", 390, has_touch=True) as seen:
        page = seen.page
        page.locator(".card").nth(0).click()
        assert page.locator("#viewer-title").inner_text().startswith("run, view 0°, 90°, instance 0")
        picture = "id => document.getElementById(id).toDataURL()"

        def changes(canvas: str, act: Any) -> bool:
            before = page.evaluate(picture, canvas)
            act()
            return bool(page.evaluate(picture, canvas) != before)

        page.locator("#turning").scroll_into_view_if_needed()
        box = page.locator("#turning").bounding_box()

        def drag() -> None:
            page.mouse.move(box["x"] + 50, box["y"] + 50)
            page.mouse.down()
            page.mouse.move(box["x"] + 120, box["y"] + 80, steps=3)
            page.mouse.up()

        assert changes("turning", drag)
        page.locator("#turning").focus()
        assert changes("turning", lambda: page.keyboard.press("ArrowLeft"))
        assert changes("turning", lambda: page.keyboard.press("+"))
        assert changes("overlay", lambda: page.locator("#frame").fill("3"))
        assert "frame 3: MPJPE" in page.locator("#reading").inner_text()
        assert changes("overlay", lambda: page.locator("#viewer-camera").select_option(index=1))
        page.locator("#viewer-method").select_option(label="random@pca")
        page.locator("#play").click()
        readings = set()
        for _ in range(3000):  # two minutes at the most
            page.wait_for_timeout(40)
            readings.add(page.locator("#reading").inner_text())
            if len(readings) > 2:
                break
        assert len(readings) > 2
        page.locator("#play").click()
        assert page.locator("#play").inner_text() == "Play"
        assert seen.complaints == []


def test_a_row_gives_the_command_that_runs_it_again(chromium: Any, swept: Path) -> None:
    commands = {repeat_command(row["spec"]) for row in Ledger(swept / "results").rows()}
    with opened(chromium, swept / "report.html") as seen:
        buttons = seen.page.locator("#all-rows button", has_text="command")
        assert buttons.count() == len(commands) == 24
        found = set()
        for k in range(buttons.count()):
            buttons.nth(k).click()
            found.add(seen.page.locator("#command").text_content())
            seen.page.locator("#again .close").click()
        assert found == commands
        buttons.nth(0).click()
        seen.page.locator("#copy").click()
        seen.page.get_by_text("copied").wait_for()


def test_a_method_is_held_against_all_others(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        seen.page.locator("#mine").select_option(label="random@pca")
        assert shown(seen.page, "#duels", 1) != []
        assert len(shown(seen.page, "#duels", 1)) == 2
        assert all(re.fullmatch(r"[1-4] of 4", text) for text in shown(seen.page, "#duels", 4))
        assert seen.page.locator("#verdict").inner_text().startswith("random@pca (default settings; 80 evaluations")
        lost = [row for row in Ledger(swept / "results").rows() if row["spec"]["method"] == "random@pca"]
        lost = [row for row in lost if row["lost_rate"] > 0.0 or row["swap_rate"] > 0.0]
        assert seen.page.locator("#tracks tbody tr").count() == len(lost)


def test_the_paper_is_tested(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        said = seen.page.locator(".claim").inner_text()
        assert "particle@full" in said
        assert said.count("paired Wilcoxon, Holm over all steps, 6 pairs: p ") == 2


@pytest.fixture(scope="module")
def certain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certain")
    first = replace(cells(1)[0], frames=4)
    modes = {"a": [[8, 0.55, 0.5], [32, 0.98, 0.9]], "b": [[40, 0.7, 0.2]]}
    made = [
        result(replace(first, method=m, seed=s), 1.0 + s, **(sure(0.8, 60.0, modes[m], 0.25) if m in modes else {}))
        for m in ("a", "b", "silent")
        for s in (0, 1, 2)
    ]
    assert run("report", ledger(folder / "results", made), "--out", folder / "report.html").exit_code == 0
    return folder / "report.html"


@pytest.mark.parametrize("width", [320, 390, 1280])
def test_the_page_shows_how_sure_methods_are(chromium: Any, certain: Path, width: int) -> None:
    with opened(chromium, certain, width) as seen:
        page = seen.page
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        said = [re.sub(r"\s+", " ", text) for text in page.locator("#reliability title").all_text_contents()]
        assert said == [
            "a: 55 % said, 50 % right, of 24 frames",
            "a: 98 % said, 90 % right, of 96 frames",
            "b: 70 % said, 20 % right, of 120 frames",
        ]
        assert page.locator("#coverage .mark").count() == 6
        assert page.locator("#sure tbody tr").count() == 2
        assert shown(page, "#sure", 4) == ["80.0 %"] * 2
        page.locator("#toggles button[data-method='0']").click()
        assert [page.locator(f"#{chart} polyline").count() for chart in ("reliability", "coverage")] == [1, 1]
        heads = [" ".join(text.split()) for text in page.locator("#leaders th").all_inner_texts()]
        place = next(k for k, head in enumerate(heads, 1) if head.startswith("said unknown"))
        assert shown(page, "#leaders", place)[:3] == ["25.0", "25.0", "–"]
        assert heads[place - 2].startswith("left/right swapped")
        assert seen.complaints == []


def test_where_nobody_says_how_sure_he_is_the_page_has_no_such_section(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        assert seen.page.locator("#certainty, #to-certainty").count() == 0
        assert "said unknown" not in seen.page.inner_text("#leaders")


def test_hostile_names_are_shown_as_they_are_and_do_nothing(chromium: Any, hostile: Path) -> None:
    with opened(chromium, hostile) as seen:
        assert EVIL in seen.page.locator("#facts").text_content()
        assert EVIL in seen.page.locator("#lost").text_content()
        assert seen.page.locator("img").count() == 0
        assert seen.page.locator("script").count() == 2
        seen.page.locator(".card").first.click()
        assert seen.page.locator("#overlay").is_hidden()  # no such motion: no camera
        seen.page.keyboard.press("Escape")
        seen.page.locator("#all-rows button", has_text="command").nth(1).click()
        assert f"seed = {2**60}\nEND" in seen.page.locator("#command").text_content()
        assert seen.complaints == []
        assert len(seen.requests) == 1


def test_on_paper_there_are_no_controls(chromium: Any, swept: Path) -> None:
    with opened(chromium, swept / "report.html") as seen:
        seen.page.emulate_media(media="print")
        assert seen.page.locator("#leaders table").is_visible()
        assert seen.page.locator("nav").is_hidden()
        assert seen.page.locator("#rows").is_hidden()


def test_a_page_of_failures_alone_loads_and_shows_them(chromium: Any, tmp_path: Path) -> None:
    lost = replace(cells(1)[0], seed=7)
    made = ledger(tmp_path / "results", [], [(lost, ["its process died of SIGSEGV"])])
    assert run("report", made, "--out", tmp_path / "report.html").exit_code == 0
    with opened(chromium, tmp_path / "report.html") as watched:
        assert "its process died of SIGSEGV" in watched.page.inner_text("#trouble")
        assert "random@pca on walk" in watched.page.inner_text("#failures")
        assert watched.page.locator("#leaderboard").count() == 0
        assert watched.complaints == []


@pytest.mark.parametrize("width", [390, 1280])
def test_names_fit_into_the_figures_bold_ones_too(chromium: Any, tmp_path: Path, width: int) -> None:
    first = replace(cells(1)[0], frames=4)
    names = ["particle@mmmmmmmmmmmmmmmmmmmm", "WWWW@WWWW", "sapso+vsmm", "random@pca"]
    made = [
        result(replace(first, method=name, instance=i), 1.0 + 0.1 * i + 0.001 * k)
        for k, name in enumerate(names)
        for i in range(2)
    ]
    out = tmp_path / "report.html"
    assert run("report", ledger(tmp_path / "results", made), "--out", out).exit_code == 0
    outside = """id => [...document.querySelectorAll(`#${id} svg text`)].filter((text) => {
        const [own, all] = [text, text.ownerSVGElement].map((one) => one.getBoundingClientRect());
        return own.left < all.left - 1 || own.right > all.right + 1;
    }).map((text) => text.textContent)"""
    with opened(chromium, out, width) as seen:
        for figure in ("standing", "difference", "ecdf"):
            assert seen.page.evaluate(outside, figure) == []
