"""Footage made from the truth, followed as any footage: `posefit reproduce composites VIDEO`.

People whom the library is left without walk through, come again, pass each other, or are there all the time. They are
dressed, lit and put before empty pictures of a real place, and written as video files with a calibration; what
`posefit.track` makes of these is held against what is known of them.

    experiment.py  the rows: which situations, cameras, extractions and people; what a row is made by
    situations.py  what happens, who it is, and where the cameras stand
    ways.py        walks that go on, placed and turned
    plates.py      empty pictures of a place, with what lives in them and what a sensor does
    clothes.py     what people wear
    rendering.py   people in a picture, with shadow and soft edges; the true masks
    filming.py     videos, calibration and truth of a situation
    figures.py     what masks and tracks are worth
    stills.py      a picture of a row
    tables.py      rows as a table

A cell's scene is drawn as masks, and these have to be filmed: the tracks are jobs.
"""
