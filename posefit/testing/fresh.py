"""Runs one trace in a new process, for the kit: `python -m posefit.testing.fresh` reads a case and writes its trace."""

import os
import pickle
import sys


def main() -> int:
    """Return 0, or 3 where the factory cannot be imported here."""
    answer = apart_from_prints()
    path, payload = pickle.load(sys.stdin.buffer)
    sys.path[:] = path
    try:
        case = pickle.loads(payload)
    except Exception:
        return 3
    from posefit.testing.repeat_rules import trace_again

    trace = trace_again(case)
    with os.fdopen(answer, "wb") as out:
        out.write(pickle.dumps(trace))
    return 0


def apart_from_prints() -> int:
    """Return a file descriptor of what was standard output; whatever is printed from now on goes to standard error."""
    answer = os.dup(1)
    os.dup2(2, 1)
    return answer


if __name__ == "__main__":
    sys.exit(main())
