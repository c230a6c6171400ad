"""Laws that hold for every kind: of source, of argument, of writer, of method, of mode.

A table names the kinds, one a line, and a test states a law over all of them. A new kind joins by a line in its table,
and every law is then asked of it:

| table | a line is | laws |
|---|---|---|
| `sources.MASKS`, `sources.FILMS`, `sources.MOTIONS` | a name and a function that writes the source | numbers and times, cut |
| `test_arguments.EQUAL` | an option and forms of one value | arguments |

A kind for which a law fails today is in the table all the same, as a strict xfail that says what will mend it.
"""
