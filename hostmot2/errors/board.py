"""The card's description of itself is wrong or not supported, or one of its modules is in trouble."""

from __future__ import annotations

from collections.abc import Sequence

from hostmot2.errors.base import HostMot2Error


class BoardError(HostMot2Error):
    """The card's own description of itself is wrong or not supported."""

    code = "HM2-E050"
    causes: Sequence[str] = ("a bitfile that this driver does not fit", "the card's configuration is damaged")
    fix = "`hm2 info` and `hm2 modules` show what the card says of itself; another bitfile may help."


class ModuleMissing(BoardError):
    """The card's firmware has no such module, or the card no such daughter card."""

    code = "HM2-E051"
    causes = (
        "the loaded bitfile is another than the one for this daughter card",
        "the daughter card did not answer, so that nothing told its kind",
        "the instance asked for is beyond the last one",
    )
    fix = (
        "`hm2 modules` lists what the loaded firmware contains, `hm2 sserial scan` what answers; another "
        "bitfile may have it."
    )


class UnsupportedFirmware(BoardError):
    """The loaded firmware's version of a module cannot do what was asked for."""

    code = "HM2-E042"
    causes = (
        "the bitfile is older than the feature",
        "the sources on this module contradict each other, and a guess could move a machine",
    )
    fix = "`hm2 modules` tells the versions; a newer bitfile may be able to."


class PinInUse(BoardError):
    """A pin belongs to somebody else."""

    code = "HM2-E043"
    index_of = "pin"
    causes = ("a module of the firmware has the pin", "another part of the program has taken it before")
    fix = "`hm2 pins` tells who has which pin; take another, or give it back first."


class WatchdogBite(BoardError):
    """The card's watchdog has let go of all outputs; writes are held back until it is acknowledged."""

    code = "HM2-E041"
    causes = (
        "the program waited too long between two exchanges: a slow callback, a debugger, a blocking call",
        "the machine was late: no real-time scheduling, swapping, power saving",
        "the time-out is shorter than what is done between exchanges (the first start of smart serial takes "
        "36 ms for a 7I77, 90 ms beside an empty channel)",
        "the link to the card was lost for a while",
    )
    fix = (
        "Find out what kept the host from its exchanges, then call watchdog.acknowledge(). Outputs stay off "
        "until then; encoders went on counting."
    )


class FaultPresent(BoardError):
    """Something was to be enabled while its fault input is active; it stays off.

    index: the instance.
    """

    code = "HM2-E044"
    index_of = "instance"
    causes = ("the drive reports a fault", "the fault input's polarity is the other one", "its wire is open")
    fix = "Remove the cause of the fault, check the fault input's polarity, then enable again."


class ModuleTimeout(BoardError, TimeoutError):
    """A module of the card did not finish what it was asked to do."""

    code = "HM2-E045"
    causes = (
        "what hangs on the module is unpowered, not connected or set up otherwise",
        "the module's rate or length is set so that the transfer takes longer than was waited",
        "the bitfile is not the one for this card",
    )
    fix = "Check power and wiring of what hangs on the module, its rate, and the bitfile (`hm2 modules`)."


class DataLost(BoardError):
    """A receiver of the card had no room: data was lost. Said once, reading goes on.

    index: the instance.
    """

    code = "HM2-E046"
    index_of = "instance"
    causes = (
        "the program reads too seldom for what the other side sends",
        "noise on an open line is taken for data",
    )
    fix = "Read more often, or make the other side send less at a time."
