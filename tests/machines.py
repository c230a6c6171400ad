"""The test suite on simulated machines: `python -m tests.machines [--seeds 3] [--only haswell] [pytest arguments]`.

The last digits of a matrix product depend on the processor that BLAS, NumPy and LLVM compile or choose loops for, and
so does all that a search makes of them. A test has to hold on any processor. Each machine here is such a choice, as far
as the processor at hand can run it; with `--seeds` each of them runs with several offsets of the fixture `seed`.
Prints a line a run, and where one fails also its failed tests; exits with status 1 then.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Machine:
    """A processor, as the libraries are to see it."""

    name: str
    blas: str  # a core type of OpenBLAS
    compiler: str  # a processor of LLVM
    level: int  # of the x86-64 microarchitecture: 2 has SSE 4.2, 3 AVX2, 4 AVX-512
    # a feature, in NumPy's words, without which the processor at hand cannot run it
    needs: str


MACHINES = (
    Machine("prescott", "Prescott", "x86-64-v2", 2, "SSE42"),
    Machine("haswell", "Haswell", "x86-64-v3", 3, "AVX2"),
    Machine("zen", "Zen", "znver2", 3, "AVX2"),
    Machine("skylakex", "SkylakeX", "x86-64-v4", 4, "AVX512_SKX"),
)


def cpu() -> Any:
    """Return NumPy's module that lists the features of the processor."""
    return np._core._multiarray_umath  # type: ignore[attr-defined]


def environment(machine: Machine, seed: int, cache: Path) -> dict[str, str]:
    """Return the environment in which tests run on a machine."""
    above = {2: r"AVX|FMA|F16C|XOP|X86_V[34]", 3: r"AVX512|X86_V4", 4: r"(?!)"}[
        machine.level
    ]
    features = [
        name
        for name in cpu().__cpu_dispatch__
        if cpu().__cpu_features__[name] and re.match(above, name)
    ]
    return os.environ | {
        "OPENBLAS_CORETYPE": machine.blas,
        "NPY_DISABLE_CPU_FEATURES": " ".join(features),
        "NUMBA_CPU_NAME": machine.compiler,
        "NUMBA_CPU_FEATURES": "",  # those of the name, not of the processor at hand
        "NUMBA_CACHE_DIR": str(cache / machine.name),
        "POSEFIT_TEST_SEED": str(seed),
    }


def run(machine: Machine, seed: int, arguments: list[str], cache: Path) -> bool:
    """Run the tests on a machine, print how it went, and return whether all passed."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        *arguments,
    ]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env=environment(machine, seed, cache),
        capture_output=True,
        text=True,
    )
    lines = (done.stdout + done.stderr).strip().splitlines() or ["no output"]
    print(f"{machine.name}, seed {seed}: {lines[-1].strip('= ')}", flush=True)
    if done.returncode:
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        print("\n".join(f"  {line}" for line in failed or lines[-20:]), flush=True)
    return done.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--seeds", type=int, default=1, help="offsets of the fixture `seed`: 0, 1, ..."
    )
    parser.add_argument(
        "--only",
        action="append",
        choices=[one.name for one in MACHINES],
        help="this machine alone",
    )
    options, arguments = parser.parse_known_args()
    passed = []
    with tempfile.TemporaryDirectory() as cache:
        for machine in (
            one for one in MACHINES if not options.only or one.name in options.only
        ):
            if cpu().__cpu_features__.get(machine.needs):
                passed += [
                    run(machine, seed, arguments, Path(cache))
                    for seed in range(options.seeds)
                ]
            else:
                print(f"{machine.name}: left out, the processor has no {machine.needs}")
    return 0 if passed and all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
