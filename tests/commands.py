"""Commands as a user types them, and what comes back."""

import json
from typing import Any

from click.testing import CliRunner, Result

from posefit.cli import main


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


def printed(*words: object) -> Any:
    """Return what a command prints with --json."""
    result = run(*words, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def error_of(*words: object) -> str:
    """Return the one line on stderr with which a command refuses its arguments, with status 2, and prints nothing."""
    result = run(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert "Usage:" not in result.stderr
    assert "Traceback" not in result.stderr
    (line,) = (
        line for line in result.stderr.splitlines() if line.startswith("posefit:")
    )
    return line
