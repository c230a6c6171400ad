"""Many environments at once: a population of proposals is one compiled call, whatever the instances are.

| looking for | file |
|---|---|
| Fit-v0, Track-v0, Configure-v0 | fit.py, track.py, configure.py |
| Fit-v1, Configure-v1 | proposing.py, configuring.py |
| what they share: seeds, instances, masks of a reset and of infos | batch.py |
| whether anyone's does what single ones do | checker.py |
| Stable-Baselines3's kind of it | sb3.py |
"""
