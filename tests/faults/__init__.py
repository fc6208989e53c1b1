"""The fault run: a real service under load that is killed, starved, stopped, and then audited.

`python -m tests.faults --kills 200` runs it and prints its counts; see `--help`.
"""
