"""Hard cases stay numerically stable: each a named test with its tolerance and the reason for it.

`python -m tests.hard_cases.table docs/hard_cases.md` runs them and writes the table with the worst values measured.
"""
