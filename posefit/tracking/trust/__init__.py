"""Can a track be trusted, where nobody knows the truth? Signs beside the mask, and one sentence that they come to.

| looking for | file |
|---|---|
| what a track and its footage show: size, depth, feet, what moves | signs.py |
| how much of what moves in the pictures the body covers | moving.py |
| the limits of each sign, and the sentence | verdict.py |
| all of it from a track | evidence.py |
"""
