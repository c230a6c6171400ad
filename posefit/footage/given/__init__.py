"""Masks that somebody gives: what their values mean, and one person of them, whole.

| looking for | file |
|---|---|
| alpha channels, palettes, labels, degrees: where a person is by the values of all masks | values.py |
| empty frames held, inverted masks turned round, holes filled, one of several people followed | settled.py |
"""
