"""The folder that `posefit ambiguity` leaves behind: it appears whole under its name, or not at all."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from posefit.ambiguity.run import Ambiguity
from posefit.ambiguity.table import summary_of
from posefit.files import new_folder

FILES = ("ambiguity.json", "ambiguity.png")


@contextmanager
def written_to(path: str | None) -> Iterator[Callable[[Ambiguity], None]]:
    """Give a function that writes a result to the new folder `path`; without one, it writes nothing.

    Raises ValueError where `path` exists or cannot be written.
    """
    if path is None:
        yield lambda _found: None
        return
    with new_folder(path) as folder:

        def write(found: Ambiguity) -> None:
            import cv2

            from posefit.ambiguity.picture import picture_of

            text, picture = FILES
            (folder / text).write_text(json.dumps(summary_of(found), indent=1) + "\n", encoding="utf-8")
            if not cv2.imwrite(str(folder / picture), picture_of(found)):
                raise OSError(f"no room for {picture}")

        yield write
