"""The report in a real browser: it opens without errors, it is accessible, and its controls work."""

import json
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import pytest

from posefit.errors import printable
from posefit.sweep.repeat import BEGIN, END, repeat_command
from tests.report.browser import EVIL, ledger, opened, result, sure, written
from tests.report.searched import cell, problems, search_result, searched
from tests.sweep.fake import cells, rows_in

FIRST = replace(cells(1)[0], frames=4)
METHODS = 9  # more than there are colours


def page_of(made: Path) -> Path:
    """Return the page of a ledger."""
    written(made)
    return made.with_name("report.html")


@pytest.fixture(scope="module")
def tracks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page with every section: failures, gaps, warnings, uncertainty."""
    made = []
    modes = {0: [[8, 0.55, 0.5], [32, 0.98, 0.9]], 1: [[40, 0.7, 0.2]]}
    for m, i, s in product(range(METHODS), range(9), range(2)):
        more = (
            {"warnings": ["the search met the border of its box"]}
            if (m, i) == (2, 3)
            else {}
        )
        more |= sure(0.8, 60.0, modes[m], 0.25) if m in modes else {}
        conditions = {
            "view_degrees": (0.0, 90.0) if i == 2 else (45.0,),
            "corruption": {"holes": 0.1} if i % 2 else {},
        }
        cell = replace(
            FIRST, method=f"method-{m}@pca", instance=i, seed=s, **conditions
        )
        if (m, i) != (4, 7):
            made.append(
                result(cell, 1.0 + 0.3 * m + 0.1 * ((3 * m + i) % 5) + 0.05 * s, **more)
            )
    lost = [
        (
            replace(FIRST, method="method-4@pca", instance=7, seed=s),
            ["ValueError: it had to"],
        )
        for s in range(2)
    ]
    return page_of(ledger(tmp_path_factory.mktemp("tracks") / "results", made, lost))


@pytest.fixture(scope="module")
def searches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page of single searches by six methods, with a failure of a hostile name."""
    methods = {
        "cma": 14,
        "pso": 11,
        "sapso": 10,
        "annealed": 7,
        "scipy": 5,
        "random": 2,
    }
    lost = [(cell(EVIL, settings={EVIL: EVIL}), [f"ValueError: {EVIL}"])]
    path = tmp_path_factory.mktemp("searches") / "results"
    return page_of(searched(path, methods, problems([1, 5], [9, 24], 3), lost))


@contextmanager
def shown(chromium: Any, path: Path, width: int = 1280, **how: Any) -> Iterator[Any]:
    """Give the page of a file, which may neither complain nor request anything else."""
    with opened(chromium, path, width, **how) as watched:
        yield watched.page
        assert watched.complaints == []
        assert watched.requests == [path.as_uri()]


def texts(page: Any, table: str, column: int) -> list[str]:
    """Return the texts of a column of a table, without the small print below."""
    return [
        text.split("\n")[0]
        for text in page.locator(
            f"{table} tbody tr td:nth-child({column})"
        ).all_inner_texts()
    ]


def cell_in(command: str) -> str:
    """Return the cell of a track's command, whatever the order of its lines."""
    plan = command.removeprefix(BEGIN).removesuffix(END)
    return json.dumps(tomllib.loads(plan), sort_keys=True)


BOXES = """id => [...document.querySelectorAll(`#${id} svg text`)].map((one) => {
  const [own, all] = [one, one.ownerSVGElement].map((node) => node.getBoundingClientRect());
  return [own.left, own.top, own.right, own.bottom, own.left < all.left - 1 || own.right > all.right + 1, one.textContent];
})"""


def labels_are_apart(page: Any, figure: str) -> None:
    boxes = page.evaluate(BOXES, figure)
    assert len(boxes) > 3
    assert [box[5] for box in boxes if box[4]] == []
    for one, other in combinations(boxes, 2):
        beside = one[0] >= other[2] or one[2] <= other[0]
        assert beside or one[1] >= other[3] - 2 or one[3] <= other[1] + 2, (
            figure,
            one[5],
            other[5],
        )


@pytest.mark.slow
@pytest.mark.parametrize("width", [320, 390, 1280, 1920])
def test_it_opens_without_errors_and_is_accessible_in_every_width_and_scheme(
    chromium: Any, tracks: Path, searches: Path, width: int
) -> None:
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="pip install posefit[browser]"
    )
    figures = {
        tracks: ("standing", "convergence", "profile", "joint-errors"),
        searches: ("standing", "chart-0"),
    }
    for path, names in figures.items():
        for scheme in ("light", "dark"):
            with shown(
                chromium, path, width, color_scheme=scheme, bypass_csp=True
            ) as page:
                assert page.evaluate("document.documentElement.scrollWidth") <= width
                page.locator("#all").click()
                for name in names:
                    labels_are_apart(page, name)
                violations = axe.Axe().run(page).response["violations"]
                assert [
                    (rule["id"], [node["html"] for node in rule["nodes"]])
                    for rule in violations
                ] == []


def test_the_first_screen_has_the_leader_the_figure_and_failures(
    chromium: Any, tracks: Path
) -> None:
    with shown(chromium, tracks, reduced_motion="reduce") as page:
        assert page.inner_text("#headline").startswith(
            "method-0@pca lost frames in none of 16 tracks and has an error with losses of"
        )
        for part in ("#headline", "#problems", "#standing"):
            assert page.locator(part).bounding_box()["y"] < 900, part
        assert page.locator("#standing .mark").count() == METHODS
        assert page.locator("#standing .baseline").count() == 3
        for text in (
            "2 x ValueError: it had to",
            "instance 7: no run of method-4@pca",
            "2 runs with a warning",
        ):
            assert text in page.inner_text("#problems")
        links = page.locator("#sections a").all_inner_texts()
        assert links == [
            "Leaderboard",
            "Comparison",
            "Curves",
            "Joints",
            "Uncertainty",
            "All runs",
            "Failures",
        ]
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        page.emulate_media(media="print")
        for part in (
            "#headline",
            "#standing svg",
            "#facts",
            "#problems",
            "#leaders table",
        ):
            assert page.locator(part).is_visible(), part
        for part in ("nav", "#rows"):
            assert page.locator(part).is_hidden(), part


def test_tables_sort_and_compare_and_mark_warnings(chromium: Any, tracks: Path) -> None:
    with shown(chromium, tracks) as page:
        heads = page.locator("#leaders th")
        data = json.loads(page.locator("#data").text_content())
        names = [row["name"] for row in data["leaderboard"]]
        pairs = zip(texts(page, "#leaders", 1)[:METHODS], names, strict=True)
        assert all(text.startswith(name) for text, name in pairs)
        heads.nth(1).locator("button").focus()
        page.keyboard.press("Enter")
        assert heads.nth(1).get_attribute("aria-sort") == "ascending"
        errors = [float(text) for text in texts(page, "#leaders", 2)]
        assert errors == sorted(errors)
        assert len(errors) == METHODS + 3  # and baselines
        page.keyboard.press("Enter")
        assert [float(text) for text in texts(page, "#leaders", 2)] == errors[::-1]
        visible = [k for k in range(heads.count()) if heads.nth(k).is_visible()]
        assert len(visible) <= 8
        page.locator("#leaders").get_by_text("more columns").click()
        for k in range(heads.count()):
            heads.nth(k).locator("button").click()
            assert heads.nth(k).get_attribute("aria-sort") in (
                "ascending",
                "descending",
            )
        page.locator("#of-method").select_option(label="method-2@pca")
        warned = page.locator("#all-rows [role=img]")
        assert warned.count() == 2
        assert (
            warned.first.get_attribute("aria-label")
            == "warning: the search met the border of its box"
        )
        page.locator("#against").select_option(label="method-3@pca")
        assert texts(page, "#pairs", 6).count("better") == METHODS - 4
        page.locator("#against").select_option(label="method-8@pca")
        assert all(
            re.fullmatch(r"[1-9] of [89]", text) for text in texts(page, "#duels", 3)
        )


def test_buttons_show_and_hide_methods_and_their_intervals_in_every_chart(
    chromium: Any, tracks: Path
) -> None:
    charts = ("convergence", "profile", "joint-errors")
    with shown(chromium, tracks) as page:

        def counts() -> list[int]:
            return [
                page.locator(f"#{chart} [data-method='0']").count() for chart in charts
            ]

        button = page.locator("#toggles button[data-method='0']")
        assert page.locator("#toggles button[aria-pressed=true]").count() == 4
        assert counts() == [1, 1, 27]
        marks = page.locator("#toggles .mark")
        shape = "one => one.getAttribute('style') + one.getAttribute('d')"
        assert len({marks.nth(k).evaluate(shape) for k in range(METHODS)}) == METHODS
        assert page.locator("#sure tbody tr").count() == 2
        band = page.locator("#convergence [data-method='0'] .band")
        opacity = "one => Number(getComputedStyle(one).opacity)"
        assert 0.0 < band.evaluate(opacity) < 0.2
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        assert counts() == [0, 0, 0]
        page.locator("#none").click()
        assert page.locator("#profile path").count() == 0
        page.locator("#all").click()
        assert page.locator("#profile .curve").count() == METHODS


def test_hostile_names_are_text_and_commands_repeat_their_rows(
    chromium: Any, tmp_path: Path
) -> None:
    named = [
        replace(FIRST, method=EVIL, motion=EVIL, settings={EVIL: EVIL}, seed=seed)
        for seed in (0, 2**60)
    ]
    plain = [replace(FIRST, motion=EVIL, seed=seed) for seed in (0, 2**60)]
    rows = [result(cell, 1.0 + k) for k, cell in enumerate([*named, *plain])]
    lost = [(replace(FIRST, method=EVIL, seed=7), [f"ValueError: {EVIL}"])]
    made = ledger(tmp_path / "results", rows, lost)
    with shown(chromium, page_of(made)) as page:
        for part in ("#headline", "#facts", "#lost"):
            assert printable(EVIL) in page.locator(part).text_content()
        assert page.locator("img").count() == 0
        assert page.locator("script").count() == 2
        assert page.locator("#certainty, #sections a[href='#certainty']").count() == 0
        commands = set()
        finished = rows_in(made)
        codes = page.locator("#all-rows code").all_inner_texts()
        assert sorted(codes) == sorted(
            f"posefit rerun results {row['key'][:8]}" for row in finished
        )
        buttons = page.locator("#all-rows td button")
        for k in range(buttons.count()):
            buttons.nth(k).click()
            commands.add(cell_in(page.locator("#command").text_content()))
            page.locator("#again .close").click()
        specs = [row["spec"] for row in finished]
        assert commands == {cell_in(repeat_command(spec)) for spec in specs}
        buttons.nth(0).click()
        page.locator("#copy").click()
        page.get_by_text("copied").wait_for()


def test_single_searches_have_curves_and_running_times(
    chromium: Any, searches: Path
) -> None:
    with shown(chromium, searches) as page:
        assert page.inner_text("#headline").startswith(
            "No method leads; cma, which comes first, reached 51.7 % of all targets"
        )
        for part in ("#headline", "#problems", "#standing"):
            box = page.locator(part).bounding_box()
            assert box["y"] + box["height"] < 900, part
        assert page.locator("#standing .mark").count() == 6
        assert page.locator("#standing .baseline").count() == 1
        assert printable(EVIL) in page.locator("#problems").text_content()
        # all functions, and each of two
        assert page.locator("#curves-charts figure").count() == 3
        assert page.locator("#curves-charts .curve").count() == 4 * 3
        page.locator("#all").click()
        assert page.locator("#curves-charts .curve").count() == 6 * 3
        rows = page.locator("#ert tbody tr")
        assert rows.count() == 6 * 2 * 2
        page.locator("#of-function").select_option(label="5 sequence")
        page.locator("#of-dimension").select_option(label="24")
        assert rows.count() == 6
        assert "cma" in rows.first.inner_text()
        assert "–" in rows.last.inner_text()
        page.locator("#lost button").last.click()
        assert 'suite = "posefit-2026.3"' in page.inner_text("#command")


def test_pages_of_one_run_or_of_failures_alone_open(
    chromium: Any, tmp_path: Path
) -> None:
    search = cell("cma")
    single = page_of(ledger(tmp_path / "one" / "results", [search_result(search, 5)]))
    with shown(chromium, single) as page:
        assert "if a function has several" in page.inner_text("#standing-note")
    for k, (lost, name) in enumerate(
        ((replace(FIRST, seed=7), "random@pca on walk"), (search, "cma on f1 in 9D"))
    ):
        failed = ledger(
            tmp_path / str(k) / "results", [], [(lost, ["its process died of SIGSEGV"])]
        )
        with shown(chromium, page_of(failed), 390) as page:
            assert page.inner_text("#headline") == "Every cell failed."
            assert "its process died of SIGSEGV" in page.inner_text("#problems")
            assert name in page.inner_text("#failures")
            assert page.locator("#sections a").all_inner_texts() == ["Failures"]
