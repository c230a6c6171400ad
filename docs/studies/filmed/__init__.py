"""What a track of a real walk is worth, whose truth nobody knows: `posefit reproduce footage VIDEO --roi X,Y,W,H`.

Each seed's track is held against the masks that were tracked and against masks that were made in another way; then the
way that the person goes, whether the fitted body faces it, and the steps a second, seen and fitted. How fast it is, on
one thread, comes first, while nothing else runs.

    experiment.py  the whole, and what the track of a seed is worth
    reference.py   masks made in another way
    gait.py        the way and the steps
    speed.py       frames and evaluations a second

A cell's motion has a truth, and footage has none: the tracks are jobs.
"""
