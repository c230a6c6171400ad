"""The quality of a track: errors if the truth is known, signs of trust if it is not.

| looking for | file |
|---|---|
| the figures of a track: names, labels, units, digits and meanings | measures.py |
| the columns of frames.csv; errors, baselines, certainty and steadiness | errors.py |
| whether a track can be trusted, and why | trust.py |
"""
