"""The SAPSO paper's real images, figures 8 and 10, from data sets that a user has. `posefit reproduce footage`.

recordings.py  the films of a folder: KTH's actions, HumanEva-I, CMU's motion capture database, or any film
humaneva.py    HumanEva-I's calibration, synchronisation and true virtual markers, and its error
experiment.py  single images (figure 8), 100 frames tracked (figure 10), and their pictures
"""
