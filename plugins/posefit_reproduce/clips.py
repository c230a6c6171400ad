"""Where clips of CMU lie: their names, such as 16/16_17, become paths."""

from pathlib import Path


def clip_path(folder: str | Path | None, name: str) -> Path:
    """Return the path of a clip in a folder of them. Raises ValueError where there is none."""
    if folder is None:
        raise ValueError(f"clips must be a folder of CMU clips such as {name}.amc, by --clips or POSEFIT_CMU, got none")
    path = Path(folder) / f"{name}.amc"
    if not path.is_file():
        raise ValueError(f"clips must be a folder of CMU clips such as {name}.amc, got {folder}, which has none")
    return path
