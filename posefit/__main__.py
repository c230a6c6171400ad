"""`python -m posefit` is `posefit`.

Ctrl-C ends it with one line, even while Python is still importing it.
"""

import sys

from posefit.errors import STOPPED


def main() -> None:
    """Run the command."""
    try:
        from posefit.cli import run
    except KeyboardInterrupt:
        print("Aborted!", file=sys.stderr)
        raise SystemExit(STOPPED) from None
    run()


if __name__ == "__main__":
    main()
