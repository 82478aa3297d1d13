"""The files a machine needs: `hm2 setup` prints them, and installs them if told to."""

from hostmot2.setup.files import ForeignFile, MachineFile, install
from hostmot2.setup.net import net_files
from hostmot2.setup.realtime import realtime_files
from hostmot2.setup.udev import udev_files

__all__ = ["ForeignFile", "MachineFile", "install", "net_files", "realtime_files", "udev_files"]
