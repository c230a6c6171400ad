"""What pictures of a track are made of; `posefit.tracking.picture` puts them together.

| looking for | file |
|---|---|
| which colour means what, and words in a picture | colours.py |
| a body, and the thin bones of what else it may be; limbs that are unsure are faint | body.py |
| a figure over the frames; how sure joints are, and marks of lost frames and unknown sides | chart.py |
"""
