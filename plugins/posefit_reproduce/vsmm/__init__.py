"""The experiment of the VSMM patent: CN101894278, 2010. `posefit reproduce vsmm`.

activities.py  the film: stepping, waving, jumping jacks and squats, another one for every seed
experiment.py  the methods on the films, their errors, and how probabilities and groups fare
report.py      what is printed and written
figures.py     figures 9, 10 and 11
"""
