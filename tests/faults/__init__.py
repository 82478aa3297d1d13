"""Every single fault at every step of every operation, in virtual time; and what comes from outside.

`python -m tests.faults` runs the enumeration, `python -m tests.faults.kills`, `.interrupts` and `.soak` the
rest. The layers, their steps and their faults are in layers.py, the operations in operations.py, what must
hold in checks.py.
"""
