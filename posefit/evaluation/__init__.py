"""What a track is worth: errors where the truth is known, signs of trust where it is not.

| looking for | file |
|---|---|
| the figures of a whole track: names, labels, units, digits and meanings | measures.py |
| the columns of frames.csv; errors, baselines, certainty and steadiness | errors.py |
| whether a track can be trusted, and why | trust.py |
"""
