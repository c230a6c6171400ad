"""Checks of the rules of a plugin, and their results: passed, failed or skipped."""

import re
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from posefit import limits

# how long a check may take before its plugin counts as hanging
SECONDS = 60.0
POSEFIT = Path(__file__).parents[1]  # frames of a traceback in here are not a plugin's
SAME_CAUSE = 2  # failures with the same cause after which the other checks are skipped


class BrokenError(AssertionError):
    """A rule is broken. The message has the expected and the actual value."""


class SkippedError(Exception):
    """A rule does not apply. The message is the reason."""


def expect(holds: object, message: str) -> None:
    """Raise BrokenError with the message unless `holds` is true."""
    if not holds:
        raise BrokenError(message)


@dataclass(frozen=True)
class Result:
    """The outcome of one check."""

    name: str
    outcome: Literal["passed", "failed", "skipped"]
    detail: str = ""
    traceback: str = ""  # of the plugin's error, from the plugin's first frame


@dataclass(frozen=True)
class Check:
    """One rule, ready to be checked against one plugin."""

    name: str
    body: Callable[[], str | None] = field(repr=False)

    def run(self, seconds: float | None = None) -> Result:
        """Return the result of the check.

        Args:
            seconds: Time limit, `SECONDS` by default.

        Returns:
            The result. An exception of the plugin becomes a failure.
        """
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
    """The results of all checks of one plugin. It is true if none failed."""

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
            # one traceback per cause
            if result.traceback and _cause(result.detail) not in causes:
                for line in result.traceback.splitlines():
                    lines.append(f"           {line}".rstrip())
            causes.add(_cause(result.detail))
        return "\n".join(lines)

    @property
    def summary(self) -> str:
        """How many checks ran, failed and were skipped."""
        passed = len(self.of("passed"))
        failed = len(self.of("failed"))
        skipped = len(self.of("skipped"))
        return f"{passed + failed} checks ran, {failed} failed, {skipped} skipped"


def run_checks(plugin: str | Callable[..., Any], checks: Iterable[Check]) -> Report:
    """Return the results of the checks of a plugin.

    Once two checks failed with the same cause, the others are skipped.

    Args:
        plugin: Its label, or its factory, which gives its name.
        checks: The checks, in the order in which they run.
    """
    results: list[Result] = []
    for check in checks:
        results.append(not_run(check.name, results) or check.run())
    if isinstance(plugin, str):
        return Report(plugin, tuple(results))
    function = getattr(plugin, "func", plugin)  # the function inside a `partial`
    return Report(getattr(function, "__name__", repr(plugin)), tuple(results))


def not_run(name: str, earlier: Sequence[Result]) -> Result | None:
    """Return a skipped result if earlier checks failed with the same cause, or None."""
    causes: dict[str, list[str]] = {}
    for result in earlier:
        if result.outcome == "failed":
            causes.setdefault(_cause(result.detail), []).append(result.name)
    for names in causes.values():
        if len(names) >= SAME_CAUSE:
            failed = " and ".join(names[:SAME_CAUSE])
            reason = f"not run: {failed} fail for one cause"
            return Result(name, "skipped", reason)
    return None


def _cause(detail: str) -> str:
    """Return a message without its numbers: shapes differ from check to check."""
    return re.sub(r"\d+", "", detail)


def _plugin_traceback(error: BaseException) -> str:
    """Return an error's traceback without the leading frames of posefit."""
    rest = error.__traceback__
    while rest is not None:
        # show the author the frames of the plugin, not those of the checks
        if POSEFIT not in Path(rest.tb_frame.f_code.co_filename).parents:
            return "".join(traceback.format_exception(type(error), error, rest)).strip()
        rest = rest.tb_next
    return ""
