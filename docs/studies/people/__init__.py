"""People whom the library has never seen: `posefit reproduce people`.

Files:

clips.py       the recorded clips that are followed, in groups
design.py      which tracks there are: a base, one thing changed at a time, other methods, a walker's own clips
closest.py     how near the library has anything
recovery.py    gaps, and coming back the other way: jobs
experiment.py  all of it, run
tables.py      what the tracks come to, and how it is printed

All clips are recorded ones that posefit brings along; whoever moves in one is left out of the library.
"""
