"""The boards we know: connectors, port counts and widths, as data.

Only names and numbers that a card cannot say itself are here; what the IDROM says wins wherever a board is
not in the table. Source: fact sheet boards 1 to 4, registers 1.5.
"""

from __future__ import annotations

from dataclasses import dataclass

DB25_ORDER = (1, 14, 2, 15, 3, 16, 4, 17, 5, 6, 7, 8, 9, 10, 11, 12, 13)
"""The DB25 pin of each bit of a 17-bit port."""

_RAW_WIDTHS = (19, 21, 27, 29, 30, 32)


@dataclass(frozen=True, slots=True)
class BoardFacts:
    """One board.

    name: what its transport calls it. idrom_name: what its IDROM calls it, which several boards may share.
    connectors: one per port, in I/O order; "" where a port has no single connector. leds: user LEDs.
    """

    name: str
    idrom_name: str
    io_ports: int
    port_width: int
    connectors: tuple[str, ...]
    leds: int
    fpga: str

    def connector_pin(self, index: int) -> tuple[str, int | None]:
        """Connector and pin number of I/O `index`; no number where the port is not one plain connector.

        17-bit ports are DB25s, 24-bit ports use the odd pins of a 50-pin header.
        """
        port, bit = divmod(index, self.port_width)
        connector = self.connectors[port]
        if not connector.startswith(("P", "J")):
            return connector, None
        if self.port_width == 17:
            return connector, DB25_ORDER[bit]
        if self.port_width == 24:
            return connector, 2 * bit + 1
        return connector, bit + 1 if self.port_width in _RAW_WIDTHS else None


def _row(name: str, idrom: str, width: int, connectors: str, leds: int, fpga: str) -> BoardFacts:
    names = tuple(connectors.split())
    return BoardFacts(name, "MESA" + idrom, len(names), width, names, leds, fpga)


BOARDS: tuple[BoardFacts, ...] = (
    # Ethernet; names as in LBP16 space 7
    _row("7I76E-16", "7I76", 17, "on-card P1 P2", 4, "6slx16ftg256"),
    _row("7I76EU", "7I76", 17, "on-card P1 P2", 4, "T20F256"),
    _row("7I80DB-16", "7I80", 17, "J2 J3 J4 J5", 4, "6slx16ftg256"),
    _row("7I80DB-25", "7I80", 17, "J2 J3 J4 J5", 4, "6slx25ftg256"),
    _row("7I80HD-16", "7I80", 24, "P1 P2 P3", 4, "6slx16ftg256"),
    _row("7I80HD-25", "7I80", 24, "P1 P2 P3", 4, "6slx25ftg256"),
    _row("7I80HDT", "7I80", 24, "P1 P2 P3", 4, "T20F256"),
    _row("7I92", "7I92", 17, "P2 P1", 4, "6slx9tqg144"),
    _row("7I92T", "7I92", 17, "P2 P1", 4, "T20F256"),
    _row("7I93", "7I93", 24, "P2 P1", 4, "6slx9tqg144"),
    _row("7I94", "7I94", 21, "expansion,serial0-1 serial1-7", 4, "6slx9tqg144"),
    _row("7I94T", "7I94", 21, "expansion,serial0-1 serial1-7", 4, "T20F256"),
    _row("7I95", "7I95", 29, "step/dir,serial,encoders I/O,expansion", 4, "6slx9tqg144"),
    _row("7I95T", "7I95", 29, "step/dir,serial,encoders I/O,expansion", 4, "T20F256"),
    _row("7I96", "7I96", 17, "TB3 TB1/TB2 P1", 4, "6slx9tqg144"),
    _row("7I96S", "7I96", 17, "TB3 TB1/TB2 P1", 4, "T20F256"),
    _row("7I97", "7I97", 17, "TB1/TB2/TB3 TB4/TB5 P1", 4, "6slx9tqg144"),
    _row("7I97T", "7I97", 17, "TB1/TB2/TB3 TB4/TB5 P1", 4, "T20F256"),
    _row("7I98", "7I98", 17, "P1 P2 P3", 4, "6slx9tqg144"),
    _row("litehm2", "LITE", 24, "P1 P2 P3", 1, "6slx16ftg256"),
    _row("MC04", "MC04", 30, "P1 P2", 4, "6slx9tqg144"),
    _row("8CSS", "8CSS", 30, "P1 P2", 4, "6slx9tqg144"),
    # PCI and PCIe; names by their PCI ids
    _row("5I20", "5I20", 24, "P2 P3 P4", 8, "2s200pq208"),
    _row("4I65", "4I65", 24, "P1 P3 P4", 8, "2s200pq208"),
    _row("4I68", "4I68", 24, "P1 P2 P4", 4, "3s400pq208"),
    _row("5I21", "5I21", 32, "P1 P1", 8, "3s400pq208"),
    _row("5I22-1.5M", "5I22", 24, "P2 P3 P4 P5", 8, "3s1500fg320"),
    _row("5I22-1.0M", "5I22", 24, "P2 P3 P4 P5", 8, "3s1000fg320"),
    _row("5I23", "5I23", 24, "P2 P3 P4", 2, "3s400pq208"),
    _row("4I69-16", "4I69", 24, "P1 P3 P4", 8, "6slx16ftg256"),
    _row("4I69-25", "4I69", 24, "P1 P3 P4", 8, "6slx25ftg256"),
    _row("3X20-1.0M", "3X20", 24, "P4 P5 P6 P9 P8 P7", 0, "3s1000fg456"),
    _row("3X20-1.5M", "3X20", 24, "P4 P5 P6 P9 P8 P7", 0, "3s1500fg456"),
    _row("3X20-2.0M", "3X20", 24, "P4 P5 P6 P9 P8 P7", 0, "3s2000fg456"),
    _row("5I24", "5I24", 24, "P4 P3 P2", 4, "6slx16ftg256"),
    _row("5I25", "5I25", 17, "P3 P2", 2, "6slx9tqg144"),
    _row("5I25T", "5I25", 17, "P3 P2", 2, "T20F256"),
    _row("6I24", "6I24", 24, "P4 P3 P2", 4, "6slx16ftg256"),
    _row("6I25", "6I25", 17, "P3 P2", 2, "6slx9tqg144"),
    _row("6I25T", "6I25", 17, "P3 P2", 2, "T20F256"),
    # SPI, EPP, USB, serial
    _row("7I90HD", "7I90", 24, "P1 P2 P3", 2, "6slx9tqg144"),
    _row("7C80", "7C80", 27, "embedded outputs,P1", 4, "6slx9tqg144"),
    _row("7C81", "7C81", 19, "P1 P2 P7", 4, "6slx9tqg144"),
    _row("7I43", "7I43", 24, "P4 P3", 8, "3s400tq144"),
)
"""Every board. 4I74 is absent on purpose: the sources disagree about its ports (24 or 21 wide)."""


def find(name: str, *, port_width: int | None = None, io_ports: int | None = None) -> BoardFacts | None:
    """The board called `name` by its transport or its IDROM; None if there is none.

    A transport's name must match exactly (upper and lower case alike), the longest first, so that a 7I92T is
    not taken for a 7I92. IDROM names are shared by boards: if those differ in connectors, the one with the
    given port width and count is taken, and None if there is none.
    """
    wanted = name.strip().upper()
    for board in sorted(BOARDS, key=lambda row: len(row.name), reverse=True):
        if board.name.upper() == wanted:
            return board
    family = [board for board in BOARDS if board.idrom_name.upper() == wanted]
    if len({(row.connectors, row.port_width) for row in family}) > 1:
        family = [row for row in family if (row.port_width, row.io_ports) == (port_width, io_ports)]
    return family[0] if family else None
