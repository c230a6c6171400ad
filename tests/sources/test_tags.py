"""Every tagged equation and step has one home in the code, and a test beside its tag."""

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
TAG = re.compile(r"# ([A-Z]+\d{4} \(.*\)|VSMM \d.*|SAPSO .*)$", re.MULTILINE)
# the comment on the line before a test, or at the end of its line
BESIDE_A_TEST = re.compile(r"^# .*\n(?=def test_)|^def test_.*\n?.*#.*", re.MULTILINE)


def test_each_tag_has_one_home_and_a_test_and_each_test_a_tag_with_a_home() -> None:
    paths = [
        path
        for folder in ("posefit", "plugins")
        for path in (ROOT / folder).rglob("*.py")
    ]
    homes = Counter(
        tag for path in paths for tag in TAG.findall(path.read_text("utf-8"))
    )
    files = [
        path
        for path in Path(__file__).parent.glob("test_*.py")
        if path.name != Path(__file__).name
    ]
    tests = "\n".join(
        line
        for path in files
        for line in BESIDE_A_TEST.findall(path.read_text("utf-8"))
    )
    assert len(homes) > 110
    assert {tag: count for tag, count in homes.items() if count > 1} == {}
    assert [tag for tag in homes if f"# {tag}" not in tests] == []
    assert set(TAG.findall(tests)) <= set(homes)


def test_the_tests_that_the_page_of_items_names_are_there() -> None:
    tests = Path(__file__).parents[1]
    page = tests.parent / "docs" / "background" / "coverage.md"
    cells = [
        row.split(" | ")[1]
        for row in page.read_text("utf-8").splitlines()
        if row.startswith("| ")
    ]
    assert len(cells) > 80
    for cell in cells:
        name = ""
        for file, test in re.findall(r"([\w/]+\.py)::|\b(test_\w+)\b(?!\.py)", cell):
            name = file or name
            path = next(
                path
                for path in (tests / "sources" / name, tests / name)
                if path.exists()
            )
            assert not test or f"def {test}(" in path.read_text("utf-8"), (name, test)


def test_each_equation_of_the_contour_fit_is_tagged_in_its_kernels() -> None:
    page = ROOT / "docs" / "background" / "contour-fit.md"
    modules = (ROOT / "posefit" / "fitting").glob("contour_*.py")
    equations = re.findall(r"\\tag\{(\d+)\}", page.read_text("utf-8"))
    tags = [
        tag
        for module in modules
        for tag in re.findall(r"\bcontour \((\d+)\)", module.read_text("utf-8"))
    ]
    assert equations == [str(k + 1) for k in range(len(equations))]
    assert set(tags) == set(equations)
