"""Mutants of the code, and whether tests notice: `python -m tests.mutants --count 60 --seed 1`.

Drawn lines carry a tag such as `# SAPSO (4)`, whose tests in `tests/sources` must then fail, or stand in a `*kernels.py`,
which the tests of its package must notice. `--packages posefit/geometry posefit/sweep` draws as many lines from each
of these packages instead, whatever they hold. In each an operator, a comparison or a number changes. Every mutant that
lives or runs out of time is printed; exit status 1 where the share of killed mutants is less than `--least`. Some
change nothing that can be noticed: a `<` of two floats that are never equal, a number that only guards.
"""

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
COPIED = ("posefit", "plugins", "envs", "tests", "docs", "pyproject.toml")
OPERATORS = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": ">=",
    ">": "<=",
    "<=": ">",
    ">=": "<",
    "&": "|",
    "|": "&",
}
NAMES = {
    "Add": "+",
    "Sub": "-",
    "Mult": "*",
    "Div": "/",
    "Lt": "<",
    "Gt": ">",
    "LtE": "<=",
    "GtE": ">=",
}
NAMES |= {"BitAnd": "&", "BitOr": "|"}
TESTS = {  # which tests notice a change of a package
    "posefit/silhouette": ["tests/silhouette"],
    "posefit/geometry": ["tests/geometry", "tests/silhouette/test_kernels.py"],
    "posefit/fitting": [
        "tests/fitting",
        "tests/tracking/test_contours.py",
        "tests/sources/test_hansen2016.py",
        "tests/sources/test_sapso.py",
    ],
    "posefit/footage": ["tests/footage", "tests/laws"],
    "posefit/output": [
        "tests/laws/test_writers.py",
        "tests/measuring",
        "tests/tracking/test_page.py",
        "tests/tracking/test_picture.py",
        "tests/tracking/test_result.py",
    ],
    "posefit/sweep": ["tests/sweep", "tests/cli"],
    "plugins/posefit_exemplars": ["tests/sources", "tests/exemplars"],
}
SECONDS = 300.0  # that the tests of one mutant have


class Mutant(NamedTuple):
    """A change of one line, and the tests that must notice it."""

    path: str
    line: int
    before: str
    after: str
    tests: tuple[str, ...]


def mutants() -> Iterator[Mutant]:
    """Yield every mutant of every line with a tag, and of every kernel."""
    sys.path.insert(0, str(ROOT / "docs"))
    from generator import equations

    for tag in equations.tags():
        tests = tuple(f"tests/sources/{name}" for name in equations.tests_of(tag))
        if tests:
            yield from _of_lines(tag.path, {tag.line}, tests)
    for path in sorted(ROOT.glob("p*/**/*kernels.py")):
        name = path.relative_to(ROOT).as_posix()
        folder = path.parent.relative_to(ROOT).as_posix()
        yield from _of_lines(name, None, tuple(TESTS.get(folder, ["tests/sources"])))


def of_package(package: str) -> Iterator[Mutant]:
    """Yield every mutant of a package, with its test files: those that name the module most come first."""
    files = list[Path]()
    for name in TESTS[package]:
        path = ROOT / name
        files += sorted(path.glob("test_*.py")) if path.is_dir() else [path]
    texts = {file: file.read_text("utf-8") for file in files}
    for path in sorted((ROOT / package).glob("*.py")):
        ordered = sorted(
            files,
            key=lambda file: (path.stem in file.stem, texts[file].count(path.stem)),
            reverse=True,
        )
        names = tuple(file.relative_to(ROOT).as_posix() for file in ordered)
        yield from _of_lines(path.relative_to(ROOT).as_posix(), None, names)


def _of_lines(
    path: str, lines: set[int] | None, tests: tuple[str, ...]
) -> Iterator[Mutant]:
    """Yield the mutants of some lines of a file, or of all."""
    text = (ROOT / path).read_text("utf-8")
    source = text.splitlines()
    tree = ast.parse(text)
    hints = set(_hints(tree))
    for node in ast.walk(tree):
        if node in hints:
            continue
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, float | int)
            and not isinstance(node.value, bool)
        ):
            number = node.lineno
            line = source[number - 1]
            left = node.col_offset
            right = node.end_col_offset or 0
            # Python 3.11 misplaces what stands in an f-string
            if (
                line.isascii()
                and _number(line[left:right]) == node.value
                and (lines is None or number in lines)
            ):
                value = (
                    node.value + 1
                    if isinstance(node.value, int)
                    else 1.5 * node.value or 1.0
                )
                changed = f"{line[:left]}{value!r}{line[right:]}"
                yield Mutant(path, number, line.strip(), changed, tests)
            continue
        if isinstance(node, ast.BinOp):
            start = node.left
            stop = node.right
            kind = type(node.op).__name__
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            start = node.left
            stop = node.comparators[0]
            kind = type(node.ops[0]).__name__
        else:
            continue
        number = start.end_lineno or 0
        left = start.end_col_offset or 0
        right = stop.col_offset
        if (
            kind not in NAMES
            or number != stop.lineno
            or (lines is not None and number not in lines)
        ):
            continue
        line = source[number - 1]
        sign = NAMES[kind]
        between = line[left:right]
        if line.isascii() and between.count(sign) == 1:
            changed = (
                line[:left] + between.replace(sign, OPERATORS[sign]) + line[right:]
            )
            yield Mutant(path, number, line.strip(), changed, tests)


def _hints(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield what stands in type hints and in `isinstance`: a change there ends every import, so any test notices."""
    for node in ast.walk(tree):
        hint = getattr(node, "annotation", None) or getattr(node, "returns", None)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
            hint = node.args[1]
        if hint is not None:
            yield from ast.walk(hint)


def _number(text: str) -> float | None:
    """Return the number that a text spells."""
    try:
        return float(ast.literal_eval(text))
    except (SyntaxError, TypeError, ValueError):
        return None


def failed(tests: tuple[str, ...], copy: Path) -> str:
    """Return the first of the tests that fails, or "". Raises TimeoutExpired."""
    paths = os.pathsep.join(str(copy / name) for name in (".", "plugins", "envs"))
    words = [
        sys.executable,
        *("-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"),
        *tests,
    ]
    ran = subprocess.run(
        words,
        cwd=copy,
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        encoding="utf-8",
        timeout=SECONDS,
    )
    if ran.returncode == 0:
        return ""
    # below 0 a signal ended it: a kernel that writes beyond its arrays
    if ran.returncode not in (3, 5):
        named = re.search(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
        return named[1] if named else tests[0]
    raise RuntimeError(f"tests must pass or fail, got\n{ran.stdout}{ran.stderr}")


def killer(mutant: Mutant, copy: Path) -> str | None:
    """Return the test that a mutant fails, "" if it lives, None if its time runs out."""
    file = copy / mutant.path
    text = file.read_text("utf-8")
    lines = text.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.after + "\n"
    file.write_text("".join(lines), "utf-8")
    try:
        # the likeliest file alone is quicker than after all others are imported
        first = failed(mutant.tests[:1], copy)
        return first or (failed(mutant.tests[1:], copy) if mutant.tests[1:] else "")
    except subprocess.TimeoutExpired:
        return None
    finally:
        file.write_text(text, "utf-8")


def main() -> int:
    """Try the mutants that are drawn, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--packages", nargs="*", default=[], choices=sorted(TESTS))
    parser.add_argument("--least", type=float, default=0.8)
    asked = parser.parse_args()
    packages = [sorted(set(of_package(name))) for name in asked.packages]
    groups = packages or [sorted(set(mutants()))]
    share = asked.count // len(groups)
    drawn = [
        mutant
        for group in groups
        for mutant in random.Random(asked.seed).sample(group, min(share, len(group)))
    ]
    ends = list[str | None]()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        for name in COPIED:
            (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(
                ROOT / name, copy / name
            )
        for mutant in drawn:
            ends.append(killer(mutant, copy))
            end = ends[-1]
            words = (
                "OUT OF TIME" if end is None else f"killed by {end}" if end else "LIVES"
            )
            print(f"{mutant.path}:{mutant.line} {words}")
            if not end:
                print(f"  {mutant.before}\n  {mutant.after.strip()}")
            sys.stdout.flush()
        for test in sorted({end for end in ends if end}):
            if failed((test,), copy):
                print(f"FAILS WITHOUT A MUTANT {test}")
                ends = [None if end == test else end for end in ends]
    killed = sum(map(bool, ends))
    there = sum(map(len, groups))
    print(f"{killed} of {len(drawn)} mutants killed, of {there} that there are")
    return int(killed < asked.least * len(drawn))


if __name__ == "__main__":
    sys.exit(main())
