"""Mutants of the equations and the kernels, and whether tests notice: `python -m tests.mutants --count 60 --seed 1`.

Drawn lines carry a tag such as `# SAPSO (4)`, whose tests in `tests/sources` must then fail, or stand in a `*kernels.py`,
which the tests of its package must notice. In each an operator, a comparison or a number changes. Every mutant that
lives is printed; exit status 1 where the share of those that are killed is less than `--least`. Some change nothing
that can be noticed: a `<` of two floats that are never equal, a number that only guards.
"""

import argparse
import ast
import os
import random
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
KERNEL_TESTS = {  # which tests notice a change of a package's kernels
    "posefit/silhouette": ["tests/silhouette"],
    "posefit/geometry": ["tests/geometry", "tests/silhouette/test_kernels.py"],
    "posefit/fitting": ["tests/fitting", "tests/tracking/test_contours.py"],
    "plugins/posefit_exemplars": ["tests/sources", "tests/exemplars"],
}


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
        yield from _of_lines(
            name, None, tuple(KERNEL_TESTS.get(folder, ["tests/sources"]))
        )


def _of_lines(
    path: str, lines: set[int] | None, tests: tuple[str, ...]
) -> Iterator[Mutant]:
    """Yield the mutants of some lines of a file, or of all."""
    text = (ROOT / path).read_text("utf-8")
    source = text.splitlines()
    for node in ast.walk(ast.parse(text)):
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


def survives(mutant: Mutant, copy: Path) -> bool:
    """Return whether the tests pass although a line is changed."""
    file = copy / mutant.path
    text = file.read_text("utf-8")
    lines = text.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.after + "\n"
    file.write_text("".join(lines), "utf-8")
    paths = os.pathsep.join(str(copy / name) for name in (".", "plugins", "envs"))
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
        *mutant.tests,
    ]
    try:
        ran = subprocess.run(
            words,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": paths},
            capture_output=True,
            timeout=900,
        )
        # below 0 a signal ended it: a kernel that writes beyond its arrays
        if ran.returncode > 1:
            raise RuntimeError(
                f"tests must pass or fail, got\n{ran.stdout.decode()}{ran.stderr.decode()}"
            )
        return ran.returncode == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        file.write_text(text, "utf-8")


def main() -> int:
    """Try the mutants that are drawn, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=float, default=0.8)
    asked = parser.parse_args()
    every = sorted(set(mutants()))
    drawn = random.Random(asked.seed).sample(every, min(asked.count, len(every)))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        for name in COPIED:
            (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(
                ROOT / name, copy / name
            )
        killed = 0
        for mutant in drawn:
            if not survives(mutant, copy):
                killed += 1
            else:
                print(
                    f"LIVES {mutant.path}:{mutant.line}\n  {mutant.before}\n  {mutant.after.strip()}",
                    flush=True,
                )
    print(f"{killed} of {len(drawn)} mutants killed, of {len(every)} that there are")
    return int(killed < asked.least * len(drawn))


if __name__ == "__main__":
    sys.exit(main())
