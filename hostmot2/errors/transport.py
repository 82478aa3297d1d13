"""The card could not be reached, or not as asked."""

from __future__ import annotations

from collections.abc import Sequence

from hostmot2.errors.base import HostMot2Error


class TransportError(HostMot2Error):
    """The card could not be reached."""

    code = "HM2-E010"
    index_of = "transfer"
    causes: Sequence[str] = (
        "the network is down: cable, switch, or no address of this host in the card's network",
        "the card lost its power or was pulled",
        "the operating system refused; the message names its reason",
    )
    fix = "`hm2 discover` looks for cards; `hm2 doctor` looks at this machine and the link."


class TransportTimeout(TransportError, TimeoutError):
    """No answer before the deadline."""

    code = "HM2-E011"
    causes = (
        "the card is unpowered, or its cable is out: its link LED is dark",
        "another address: jumpers on 192.168.1.121, EEPROM (10.10.10.10 as shipped) or BOOTP",
        "this host has no address in the card's network, or a firewall drops UDP port 27181",
        "the machine was late: interrupts moderated or on a busy processor, power saving",
    )
    fix = (
        "Check power, cable and address (`hm2 discover`); `hm2 doctor URL` measures the link and says "
        "what slows it."
    )


class LinkFailed(TransportError):
    """Too many exchanges failed: the link was given up (error level at its limit).

    A failed exchange adds 2 to the level, a good one takes 1 off; the limit is 10 unless the URL says
    otherwise.
    """

    code = "HM2-E090"
    causes = (
        "the cable was pulled, or card or switch lost power",
        "the machine stopped answering in time for too long: load, power saving, a driver's pause",
        "another program or a busy network took the line",
    )
    fix = (
        "Check cable and network (`hm2 doctor URL`); the card's watchdog has switched its outputs "
        "off. Then call the board's `recover()`, which writes the configuration anew, or open the "
        "board again."
    )


class TransportClosed(TransportError):
    """The board was used after close()."""

    code = "HM2-E014"
    causes = (
        "the `with` block that opened the board has ended",
        "a signal to end (SIGTERM, SIGHUP) closed the board first, outputs off",
        "this process was forked from the one that opened the board, whose card it stays",
    )
    fix = "Use the board inside its `with` block and in the process that opened it, or open it anew."


class ProtocolError(TransportError):
    """An answer that cannot be right."""

    code = "HM2-E015"
    causes = (
        "something else than a HostMot2 card answers at this address",
        "another program talks to the card at the same time",
        "the card's Ethernet firmware is newer than this driver",
    )
    fix = "`hm2 discover` names what answers; end other programs that use the card."


class StaleRequest(TransportError):
    """An old request was carried out once more while something was done that takes several.

    Nothing that was read is given. Of what was written it is not known whether it arrived, and where.
    """

    code = "HM2-E094"
    causes = (
        "a switch, bridge or wireless link between computer and card delivers datagrams twice, or late",
        "two ways through the network lead to the card",
    )
    fix = (
        "Give the card a network port and a cable of its own, and do it again; what was written, read back "
        "first. `hm2 doctor URL` measures the link."
    )


class ReadOnly(TransportError):
    """A write to a board that can only be read, or a part of it that writes when it is made."""

    code = "HM2-E016"
    causes = (
        "the board was opened with read_only=True, to look beside the program that drives it",
        "the board is a register dump (dump://)",
    )
    fix = (
        "Open the card without read_only, once no other program drives it; of a dump an emulated card can be "
        "made: emu:///PATH/board.hm2dump."
    )


class NotInDump(TransportError):
    """The word was not recorded in the dump (absent on purpose when reading it has side effects)."""

    code = "HM2-E080"
    causes = (
        "reading the register changes something (FIFOs, for instance), so `hm2 dump` left it out",
        "the module was not known to the version that took the dump",
    )
    fix = "Take the dump anew; `hm2 dump --side-effects` includes what can be read only once."


class BrokenDump(TransportError):
    """A line of a dump file is not one.

    index: the line number.
    """

    code = "HM2-E081"
    index_of = "line"
    causes = (
        "the file is no register dump",
        "a mail program or an editor changed it: wrapped lines, tabs, other characters",
        "an address stands there twice, or is no multiple of 4",
    )
    fix = "A dump is what `hm2 dump -o FILE` writes: an address, a word and a name on each line."


class CardNotFound(TransportError):
    """No card, file or transport of that name."""

    code = "HM2-E017"
    causes = (
        "a mistyped name, address or path",
        "the card is not seated, not powered, or not seen by the PCI bus (`lspci -d 2718:`)",
        "the transport needs a package that is not installed",
    )
    fix = "`hm2 discover` lists what can be opened."


class CardBusy(TransportError):
    """Another process holds the card."""

    code = "HM2-E013"
    causes = (
        "another program drives the card: LinuxCNC, or `hm2 record` in another terminal",
        "a program that was to end still runs in the background",
    )
    fix = "Only one process may drive a card: end the process named in the message."


class MappingTooSmall(TransportError):
    """The file or BAR is smaller than the 64 KiB register file."""

    code = "HM2-E019"
    causes = (
        "another BAR or file than the one with HostMot2's registers",
        "the FPGA was loaded anew while the machine ran, and the card lost its BARs",
    )
    fix = (
        "Name the BAR that holds HostMot2's registers (resource0, 3 or 5 by bridge), or a 64 KiB "
        "file; after a "
        "reload cycle the machine's power."
    )


class PermissionDenied(TransportError, PermissionError):
    """The operating system does not let us at the card."""

    code = "HM2-E012"
    causes: Sequence[str] = (
        "no udev rule gives this user the card's files",
        "the user was added to the group but has not logged in since",
        "the program runs in a container or service that does not see the device",
    )
    fix = (
        "Install the udev rule that `hm2 setup udev` prints and join its group, or run as root; "
        "`hm2 doctor` tells which of them is missing."
    )


class KernelLockdown(PermissionDenied):
    """The kernel forbids mapping the card's memory, whoever asks (Secure Boot lockdown)."""

    code = "HM2-E018"
    causes = (
        "Secure Boot is on, and the distribution's kernel locks itself down with it",
        "lockdown= on the kernel's command line",
    )
    fix = (
        "Turn Secure Boot off in the firmware setup, or boot without lockdown= on the kernel command line. "
        "Permissions do not help. Ethernet cards are not affected."
    )


class FirmwareTooOld(TransportError):
    """The card's Ethernet firmware lacks what is needed."""

    code = "HM2-E091"
    causes = ("the card left the factory before LBP16 had what is asked for",)
    fix = "Newer firmware is needed (Mesa supplies it); `hm2 ip` shows the versions."


class FlashError(TransportError):
    """The card's configuration flash does not hold what it should, or refused to."""

    code = "HM2-E092"
    causes = (
        "the power or the link failed during a write",
        "the board is one whose flash layout is not known here, so nothing is written",
        "the flash is worn or write-protected",
    )
    fix = "The fallback image still boots; write again. Do not reload or power down before a verify is good."
