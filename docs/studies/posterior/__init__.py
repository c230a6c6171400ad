"""How sure a tracker is of people whom the library has never seen: `posefit reproduce posterior`.

Files:

design.py      the recorded clips that are followed, and from where
frames.py      one track, and what is kept of its frames
fit.py         from tracks whose truth is known to what a posterior does not know of its own error
experiment.py  all of it, run: one person is left out of library and fit at a time
tables.py      what is said of left-out people, judged, and how that is printed
"""
