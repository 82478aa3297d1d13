"""Driver for Mesa "Anything I/O" FPGA cards running HostMot2 firmware."""

from hostmot2.board import Board
from hostmot2.default import hm2
from hostmot2.errors import HostMot2Error
from hostmot2.opening import open_board as open

__all__ = ["Board", "HostMot2Error", "hm2", "open"]
