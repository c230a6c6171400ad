"""Damaged and hostile files for every reader: `python -m tests.fuzz --inputs 200000 --seed 1`.

Each input is a valid file that `corpus` makes, changed by `mutator`, and given to its reader in a child process. It may be
read, or refused with one line that names it; nothing else. Input k of a seed is the same everywhere, and
`--only K` reads it alone.
"""
