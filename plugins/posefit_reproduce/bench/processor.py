"""Which instructions the compiled loops use: those of this machine, or of the one that NUMBA_CPU_NAME names."""

import os
import platform
import subprocess
import sys
from pathlib import Path

from posefit.errors import InputError
from posefit.reading import quoted

# Sixteen numbers of 32 bits, each shifted by another: every set of instructions has its own way to do it.
_PROBE = """
define <16 x i32> @shifted(<16 x i32> %bits, <16 x i32> %by) {
  %out = shl <16 x i32> %bits, %by
  ret <16 x i32> %out
}
"""
_SIGNS = (("zmm", "AVX-512"), ("vpsllvd", "AVX2"), ("vpmulld", "AVX"), ("pmulld", "SSE4"), ("pmuludq", "SSE2"))


def processor() -> dict[str, str]:
    """Return this machine's processor, the one that loops are compiled for as LLVM calls it, and its instructions."""
    from numba.core.registry import cpu_target

    _, name, features = cpu_target.target_context.codegen().magic_tuple()
    return {"name": _own_name(), "compiled_for": name, "features": instructions(name, features)}


def instructions(name: str, features: str = "") -> str:
    """Return the widest instructions that LLVM uses for a processor: AVX-512, AVX2, AVX, SSE4, SSE2, or else its kind.

    `features` are added to or taken from those that its name stands for, as in "+avx2,-avx512f".
    """
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_default_triple().create_target_machine(cpu=name, features=features)
    assembly = target.emit_assembly(binding.parse_assembly(_PROBE))
    return next((kind for sign, kind in _SIGNS if sign in assembly), platform.machine())


def check_named() -> None:
    """Return nothing. Raises ValueError where NUMBA_CPU_NAME names no processor that loops can be compiled for.

    LLVM passes over a name that it does not know, and later ends the process: a child process tries it.
    """
    name = os.environ.get("NUMBA_CPU_NAME")
    if not name:
        return
    code = "import sys; from posefit_reproduce.bench.processor import instructions; instructions(sys.argv[1])"
    tried = subprocess.run([sys.executable, "-c", code, name], capture_output=True, text=True, check=False)
    if tried.returncode or "not a recognized processor" in tried.stderr:
        raise InputError(f"NUMBA_CPU_NAME must name a processor of {platform.machine()}, got {quoted(name)}")


def _own_name() -> str:
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text().splitlines() if listed.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
