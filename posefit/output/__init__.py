"""The results of a track: files, pictures, a page and a printed table.

| looking for | file |
|---|---|
| the output folder, which appears only when it is complete | folder.py |
| the record from which an interrupted track continues | record.py |
| whether two tracks have the same arguments | identity.py |
| every file of a track, one line per format | files.py |
| the data that the files are made of | content.py |
| overlay.mp4, summary.png and the page, frame by frame | pictures.py |
| the picture of one frame | picture.py, drawing.py |
| the page, track.html | page/ |
| the text that is printed | text.py |
"""
