"""Driver for Mesa "Anything I/O" FPGA cards running HostMot2 firmware."""

from hostmot2.errors import HostMot2Error

__all__ = ["HostMot2Error"]
