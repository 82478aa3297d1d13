"""Every single fault at every step of every operation, in virtual time; and what comes from outside.

`python -m tests.faults` runs the enumeration, `python -m tests.faults.kills`, `.interrupts`, `.forks`,
`.endings` and `.soak` the rest. The layers, their steps and their faults are in layers.py, the operations in
operations.py and adapter.py, what must hold in checks.py.
"""
