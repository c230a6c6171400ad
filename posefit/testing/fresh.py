"""Runs one trace in a new process, for the kit: `python -m posefit.testing.fresh` reads a case and writes its trace."""

import pickle
import sys


def main() -> int:
    """Return 0, or 3 where the factory cannot be imported here."""
    path, payload = pickle.load(sys.stdin.buffer)
    sys.path[:] = path
    try:
        case = pickle.loads(payload)
    except Exception:
        return 3
    from posefit.testing.repeat_rules import trace_again

    trace = trace_again(case)
    sys.stdout.buffer.write(pickle.dumps(trace))
    return 0


if __name__ == "__main__":
    sys.exit(main())
