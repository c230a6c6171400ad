"""Smoothing of a track: no jitter, planted feet, contours that match the masks.

| looking for | file |
|---|---|
| one step of the pipeline: path, contours, path | smooth.py |
| the likeliest path of a root and two legs; which foot stands | path.py |
| poses, path and build fitted to the contours of the masks | contours.py |
| legs straightened where masks of one camera allow it | standing.py |
| legs exchanged where one camera mistakes one for the other | legs.py |
"""
