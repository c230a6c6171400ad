"""What a track leaves behind: files, pictures, a page and a printed table.

| looking for | file |
|---|---|
| the folder that appears whole | folder.py |
| what a track goes on from that ended too early; whether two tracks are the same | record.py, identity.py |
| every file, a line a format; what they are made of | files.py, content.py |
| pictures: overlay.mp4 and summary.png | picture.py, drawing.py |
| the page, track.html | page/ |
| what is printed | text.py |
"""
