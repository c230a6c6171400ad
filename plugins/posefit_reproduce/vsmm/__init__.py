"""The experiment of the VSMM patent: CN101894278, 2010. `posefit reproduce vsmm`.

activities.py  the films: stepping, waving, jumping jacks and squats, one for each seed
experiment.py  the methods on the films: all runs
tables.py      errors, switches, claims with verdicts, film by film
figures.py     figures 9, 10 and 11
"""
