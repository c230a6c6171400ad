"""The pages' scripts, style and markup: every script is used, the linter accepts them, colours have contrast."""

import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from posefit.output import page as track_page
from posefit.page.document import SHARED, one_script, part
from posefit.report import page as report_page
from posefit.report.figures import COLOURS

ROOT = Path(__file__).parents[2]
MIN_CONTRAST = 4.5  # WCAG 2.2, 1.4.3, of text; here of marks and lines too


def test_every_script_is_part_of_its_page_once():
    for page in (report_page, track_page):
        for package, names in (("posefit.page", SHARED), (page.__name__, page.SCRIPTS)):
            texts = {
                one.name: one.read_text("utf-8")
                for one in files(package).iterdir()
                if one.name.endswith(".js")
            }
            assert sorted(texts) == sorted(f"{name}.js" for name in names)
            assert all(
                one_script(page.__name__, page.SCRIPTS).count(text) == 1
                for text in texts.values()
            )


def linted(path, text):
    """Return the exit status and the output of the linter for a script that runs as a whole."""
    program = shutil.which("oxlint") or pytest.skip(
        "the linter oxlint is not installed: pip install posefit[dev]"
    )
    path.write_text(text, encoding="utf-8")
    # single files do not know what others declare
    rules = ["no-undef", "no-unused-vars", "no-redeclare"]
    command = [
        program,
        "--config",
        ROOT / ".oxlintrc.json",
        "--deny-warnings",
        *(f"--deny={rule}" for rule in rules),
    ]
    done = subprocess.run([*command, path], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def test_the_linter_accepts_the_scripts_and_rejects_planted_mistakes(tmp_path):
    for page in (report_page, track_page):
        status, output = linted(
            tmp_path / "page.js", one_script(page.__name__, page.SCRIPTS)
        )
        assert status == 0, output
        assert "on 1 file" in output
    whole = one_script(report_page.__name__, report_page.SCRIPTS)
    mistakes = {
        "missing(1);": "no-undef",
        "const unused = 1;": "no-unused-vars",
        "if (D == null) paint();": "eqeqeq",
    }
    for mistake, rule in mistakes.items():
        planted = re.sub(r"\n\}\)\(\);\n$", f"\n{mistake}\n}})();\n", whole)
        status, output = linted(tmp_path / "page.js", planted)
        assert status != 0
        assert rule in output


def luminance(colour):
    """Return the relative luminance of WCAG 2.2, of a colour such as #fff or #0063a6."""
    digits = colour.removeprefix("#")
    pairs = (
        [one * 2 for one in digits]
        if len(digits) == 3
        else [digits[k : k + 2] for k in (0, 2, 4)]
    )
    parts = [int(one, 16) / 255.0 for one in pairs]
    linear = [
        one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4
        for one in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def test_colours_have_contrast_with_their_background_in_light_and_dark():
    assert contrast("#fff", "#000000") == pytest.approx(21.0)
    # the well-known grey that just fails
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)
    schemes = re.findall(
        r":root \{([^}]*--card[^}]*)\}", part("posefit.page", "base.css")
    )
    assert set(report_page.LIGHT) == set(report_page.DARK)
    for scheme, colours in zip(
        schemes, (report_page.LIGHT, report_page.DARK), strict=False
    ):
        base = dict(re.findall(r"--(\w+): (#\w+)", scheme))
        shown = {
            **colours,
            **{name: base[name] for name in ("ink", "soft", "accent", "bad")},
        }
        for name, colour in shown.items():
            if colour.startswith("#"):
                least = min(
                    contrast(colour, base[behind]) for behind in ("back", "card")
                )
                assert least >= MIN_CONTRAST, (name, colour)
        drawn = {colours[f"c{k}"] for k in range(report_page.COLOUR_COUNT)}
        assert len(drawn) == report_page.COLOUR_COUNT == len(COLOURS)
