"""What a kit of checks found: how many ran, which failed and why, which were skipped and why."""

import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from posefit import limits

SECONDS = 60.0  # how long a check may take before its plugin counts as one that never returns
ALIKE = 2  # checks that fail for the same cause before the others count as not worth a try


class BrokenError(AssertionError):
    """A rule is broken; the message says what was expected and what came."""


class SkippedError(Exception):
    """A rule does not apply; the message says why."""


def expect(holds: object, message: str) -> None:
    """Return nothing. Raises BrokenError with the message where something does not hold."""
    if not holds:
        raise BrokenError(message)


@dataclass(frozen=True)
class Result:
    """What became of one check."""

    name: str
    outcome: Literal["passed", "failed", "skipped"]
    detail: str = ""
    traceback: str = ""  # of what the plugin raised, from where its own code begins


@dataclass(frozen=True)
class Check:
    """One rule, ready to be checked against one plugin; calling it is a test for pytest."""

    name: str
    rule: str
    body: Callable[[], str | None] = field(repr=False)

    def run(self) -> Result:
        """Return what became of the check; nothing that a plugin does escapes."""
        try:
            with limits.timed(SECONDS):
                detail = self.body()
        except SkippedError as reason:
            return Result(self.name, "skipped", str(reason))
        except BrokenError as broken:
            return Result(self.name, "failed", str(broken))
        except TimeoutError as error:
            return Result(
                self.name, "failed", f"it must end within {SECONDS:g} s, and did not", _theirs(error.__cause__ or error)
            )
        except SystemExit as error:
            return Result(
                self.name, "failed", f"it must not end the program, got SystemExit: {error.code}", _theirs(error)
            )
        except Exception as error:  # a plugin may raise anything
            detail = f"it must not fail, got {type(error).__name__}: {error}"
            return Result(self.name, "failed", detail, _theirs(error))
        return Result(self.name, "passed", detail or "")

    def __call__(self) -> None:
        """Return nothing. Raises BrokenError where the rule is broken; skips the test where it cannot be tried."""
        result = self.run()
        if result.outcome == "skipped":
            import pytest

            pytest.skip(result.detail)
        if result.outcome == "failed":
            raise BrokenError(f"{self.rule}: {result.detail}")


@dataclass(frozen=True)
class Report:
    """The results of all checks of one plugin. It is true where none failed."""

    plugin: str
    results: tuple[Result, ...]

    def of(self, outcome: Literal["passed", "failed", "skipped"]) -> list[Result]:
        """Return the results with that outcome."""
        return [result for result in self.results if result.outcome == outcome]

    def __bool__(self) -> bool:
        return not self.of("failed")

    def __str__(self) -> str:
        lines, told = [f"{self.plugin}: {self.summary}"], set[str]()
        width = max((len(result.name) for result in self.results), default=0)
        for one in self.results:
            lines.append(f"  {one.outcome:8} {one.name:{width}}  {one.detail}".rstrip())
            if one.traceback and one.detail not in told:  # the same cause is told once
                lines += [f"           {line}".rstrip() for line in one.traceback.splitlines()]
            told.add(one.detail)
        return "\n".join(lines)

    @property
    def summary(self) -> str:
        """How many checks ran, and what came of them."""
        passed, failed, skipped = (len(self.of(outcome)) for outcome in ("passed", "failed", "skipped"))
        return f"{passed + failed} checks ran, {failed} failed, {skipped} skipped"


def run_checks(plugin: str, checks: Iterable[Check]) -> Report:
    """Return the results of the checks; once some failed for one cause, the others are not run."""
    results = Results()
    for check in checks:
        results.add(results.not_run(check.name) or check.run())
    return Report(plugin, results.all)


class Results:
    """Collects results until one cause has made so many checks fail that it would make the others fail as well."""

    def __init__(self) -> None:
        self._all: list[Result] = []
        self._cause: list[str] = []  # the checks that failed alike

    @property
    def all(self) -> tuple[Result, ...]:
        """What was added, in its order."""
        return tuple(self._all)

    def add(self, result: Result) -> None:
        """Take a result."""
        self._all.append(result)
        alike = [one.name for one in self._all if one.outcome == "failed" and one.detail == result.detail]
        if not self._cause and len(alike) == ALIKE:
            self._cause = alike

    def not_run(self, name: str) -> Result | None:
        """Return the result of a check that need not be run; None while each may say something new."""
        return Result(name, "skipped", f"not run: {' and '.join(self._cause)} fail alike") if self._cause else None


def _theirs(error: BaseException) -> str:
    """Return an error's traceback without the frames of the kit that called the plugin."""
    rest = error.__traceback__
    while rest is not None and _ours(rest.tb_frame.f_code.co_filename):
        rest = rest.tb_next
    return "".join(traceback.format_exception(type(error), error, rest)).strip() if rest is not None else ""


def _ours(file: str) -> bool:
    return Path(file).parent == Path(__file__).parent or file == limits.__file__


def parametrize(checks: Sequence[Check]) -> Any:
    """Return the pytest mark that makes a test with the argument `check` one test a check."""
    import pytest

    return pytest.mark.parametrize("check", checks, ids=[check.name for check in checks])


Body = Callable[..., str | None]


class Checklist:
    """Collects the checks of a kind, in the order in which they are written."""

    def __init__(self) -> None:
        self._bodies: list[tuple[str, str, Body]] = []

    def __call__(self, body: Body) -> Body:
        """Add a function to the list; its name is the check's, the first line of its docstring the rule."""
        rule = (body.__doc__ or "").strip().split("\n")[0].rstrip(".")
        self._bodies.append((body.__name__, rule, body))
        return body

    def of(self, case: object) -> list[Check]:
        """Return all checks, bound to one plugin."""
        return [Check(name, rule, _bound(body, case)) for name, rule, body in self._bodies]


def _bound(body: Body, case: object) -> Callable[[], str | None]:
    return lambda: body(case)


@contextmanager
def refusal(*errors: type[Exception]) -> Iterator[list[Exception]]:
    """Collect an error that counts as a refusal."""
    caught: list[Exception] = []
    try:
        yield caught
    except errors as error:
        caught.append(error)
