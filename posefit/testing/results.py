"""The rules of a kind of plugin as checks, and their results: passed, failed with the reason, or skipped with it."""

import re
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from posefit import limits

# how long a check may take before its plugin counts as one that never returns
SECONDS = 60.0
POSEFIT = Path(__file__).parents[1]  # whose frames of a traceback are not a plugin's
SAME_CAUSE = 2  # checks that fail for the same cause before the others are not run


class BrokenError(AssertionError):
    """A rule is broken; the message has what was expected and what came."""


class SkippedError(Exception):
    """A rule does not apply; the message is the reason."""


def expect(holds: object, message: str) -> None:
    """Raise BrokenError with the message where something does not hold."""
    if not holds:
        raise BrokenError(message)


@dataclass(frozen=True)
class Result:
    """The outcome of one check."""

    name: str
    outcome: Literal["passed", "failed", "skipped"]
    detail: str = ""
    traceback: str = ""  # of what the plugin raised, from where its own code begins


@dataclass(frozen=True)
class Check:
    """One rule, ready to be checked against one plugin."""

    name: str
    body: Callable[[], str | None] = field(repr=False)

    def run(self, seconds: float | None = None) -> Result:
        """Return the result of the check within a time, by default `SECONDS`; nothing that a plugin raises escapes."""
        seconds = SECONDS if seconds is None else seconds
        try:
            with limits.timed(seconds):
                return Result(self.name, "passed", self.body() or "")
        except SkippedError as reason:
            return Result(self.name, "skipped", str(reason))
        except BrokenError as broken:
            return Result(self.name, "failed", str(broken))
        except TimeoutError as late:
            detail = f"it must end within {seconds:g} s, and did not"
            error = late.__cause__ or late
        except SystemExit as end:
            detail = f"it must not end the program, got SystemExit: {end.code}"
            error = end
        except Exception as raised:  # a plugin may raise anything
            detail = f"it must not fail, got {type(raised).__name__}: {raised}"
            error = raised
        return Result(self.name, "failed", detail, _plugin_traceback(error))


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
        lines = [f"{self.plugin}: {self.summary}"]
        causes = set[str]()
        width = max((len(result.name) for result in self.results), default=0)
        for result in self.results:
            lines.append(
                f"  {result.outcome:8} {result.name:{width}}  {result.detail}".rstrip()
            )
            # one traceback a cause
            if result.traceback and _cause(result.detail) not in causes:
                lines += [
                    f"           {line}".rstrip()
                    for line in result.traceback.splitlines()
                ]
            causes.add(_cause(result.detail))
        return "\n".join(lines)

    @property
    def summary(self) -> str:
        """How many checks ran, failed and were skipped."""
        passed, failed, skipped = (
            len(self.of(outcome)) for outcome in ("passed", "failed", "skipped")
        )
        return f"{passed + failed} checks ran, {failed} failed, {skipped} skipped"


def run_checks(plugin: str | Callable[..., Any], checks: Iterable[Check]) -> Report:
    """Return the results of the checks of a plugin, under its name or its factory's.

    Once two failed for one cause, the others are not run.
    """
    function = getattr(plugin, "func", plugin)
    results: list[Result] = []
    for check in checks:
        results.append(not_run(check.name, results) or check.run())
    return Report(
        plugin
        if isinstance(plugin, str)
        else getattr(function, "__name__", repr(plugin)),
        tuple(results),
    )


def not_run(name: str, earlier: Sequence[Result]) -> Result | None:
    """Return the result of a check that need not run, as so many failed for one cause; None where it has to."""
    causes: dict[str, list[str]] = {}
    for result in earlier:
        if result.outcome == "failed":
            causes.setdefault(_cause(result.detail), []).append(result.name)
    failed = next(
        (names[:SAME_CAUSE] for names in causes.values() if len(names) >= SAME_CAUSE),
        None,
    )
    return (
        Result(name, "skipped", f"not run: {' and '.join(failed)} fail for one cause")
        if failed
        else None
    )


def _cause(detail: str) -> str:
    """Return a message without its numbers: shapes differ from check to check."""
    return re.sub(r"\d+", "", detail)


def _plugin_traceback(error: BaseException) -> str:
    """Return an error's traceback from the plugin's first frame on, without those of posefit that called it."""
    rest = error.__traceback__
    while rest is not None:
        if POSEFIT not in Path(rest.tb_frame.f_code.co_filename).parents:
            return "".join(traceback.format_exception(type(error), error, rest)).strip()
        rest = rest.tb_next
    return ""
