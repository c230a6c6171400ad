"""Laws that hold for every kind: of source, of argument, of writer, of method, of mode.

A table names the kinds, one a line, and a test states a law over all of them. A new kind joins by a line in its table,
and every law is then asked of it:

| table | a line is | laws |
|---|---|---|
| `sources.MASKS`, `sources.FILMS`, `sources.MOTIONS`, `sources.NAMED`, `sources.STREAMS` | a name and a function that writes the source | numbers and times, cut, extraction, mirrored, files of a track |
| `test_arguments.EQUAL` | an option and forms of one value | arguments |
| `test_effort.OPTIMISERS`, `test_effort.TRACKERS`, `test_track_effort.CASES` | a method, a kind of start | evaluations reported are poses drawn |
| `test_modes.FORMS` | an autoreset mode, a form of environment | same seeds, same episodes |
| `test_writers.TIMES` | a file of a track | every rate, size, number of cameras and frames |
| `test_symmetry.RIGS` | cameras around a person | mirrored, turned, twice the pixels |
| `test_same_bits` | every registered optimiser and tracker | threads, pickling, order of cameras |

A kind for which a law fails today is in the table all the same, as a strict xfail that says what will mend it.
"""
