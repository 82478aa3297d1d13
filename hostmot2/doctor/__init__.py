"""`hm2 doctor`: what this machine does to a cycle, what to change first, and whether a change helps.

It measures, reads /proc, /sys and netlink (nothing is parsed from tools' text), advises in the order in which
changes help, and can try one: change, measure, restore.
"""

from hostmot2.doctor.examination import Examination, examine
from hostmot2.doctor.experiment import Outcome, try_change
from hostmot2.doctor.finding import Finding, Verdict

__all__ = ["Examination", "Finding", "Outcome", "Verdict", "examine", "try_change"]
