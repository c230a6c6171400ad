"""Fit-v1: a search by proposals, with an observation that says what was proposed before.

| looking for | file |
|---|---|
| the environment | single.py; many at once: `posefit_envs.vector.proposing` |
| what is remembered and shown, and what an action proposes | memory.py |
"""
