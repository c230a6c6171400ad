"""The person told from the rest of a video, and whether what was found can be a person at all.

| looking for | file |
|---|---|
| what a segmenter may look at before the first frame | film.py |
| what each frame's mask says of itself: size, motion, ghosts | signs.py |
| what all frames together say: refused, or a warning | verdict.py |
| whether several cameras see one person of the height that is given | agreement.py |
"""
