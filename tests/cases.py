"""Tests that run a table of cases as one test: a failure names its case."""

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any


def each(
    names: str | tuple[str, ...], cases: Iterable[Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator like `pytest.mark.parametrize` whose cases are one test; each has a `tmp_path` of its own."""
    arguments = (
        tuple(name.strip() for name in names.split(","))
        if isinstance(names, str)
        else names
    )
    table = list(cases)

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(test)
        fixtures = [
            parameter
            for name, parameter in signature.parameters.items()
            if name not in arguments
        ]

        @functools.wraps(test)
        def run(**given: Any) -> None:
            for number, case in enumerate(table):
                own = dict(given)
                if "tmp_path" in own:
                    own["tmp_path"] = own["tmp_path"] / f"case-{number}"
                    own["tmp_path"].mkdir()
                values = (case,) if len(arguments) == 1 else case
                try:
                    test(**dict(zip(arguments, values, strict=True)), **own)
                except BaseException as error:
                    error.add_note(f"case {number}: {case!r}")
                    raise

        del run.__wrapped__  # type: ignore[attr-defined]
        run.__signature__ = signature.replace(parameters=fixtures)  # type: ignore[attr-defined]
        return run

    return decorate
