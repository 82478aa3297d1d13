"""Back up the stored parameters of every remote, change one, compare, and put it back.

    HM2_BOARD=udp://10.10.10.10 python examples/parameter_backup.py [DIRECTORY]

Without HM2_BOARD an emulated 5I25 with a 7I77. A file per remote, as `hm2 param backup` writes them; on
a real card its EEPROM is written twice, with another watchdog time and with the one it had.
"""

import os
import sys
from pathlib import Path

import hostmot2
from hostmot2.remotes import backup


def main(directory: str = ".") -> None:
    with hostmot2.open(os.environ.get("HM2_BOARD", "emu://5i25+7i77?clock=virtual")) as hm2:
        for row in hm2.sserial.scan():
            if not row.found:
                continue
            channel = hm2.sserial.channels[row.channel]
            parameters = channel.parameters
            saved = backup.take(channel.description, parameters)
            path = Path(directory) / f"{channel.name}-{channel.unit_number:08X}.toml"
            backup.write(saved, path, parameters)
            print(f"{path}: {len(saved.values)} parameters")
            change_and_restore(channel, path)


def change_and_restore(channel: object, path: Path) -> None:
    parameters = channel.parameters
    if "NVWatchDogTimeout" not in parameters:
        return
    parameters["NVWatchDogTimeout"] = parameters["NVWatchDogTimeout"] + 50  # ms; checked and read back
    saved = backup.read(path)
    backup.check(saved, channel.description, parameters, other_unit=False)
    for difference in backup.differences(saved.values, backup.take(channel.description, parameters).values):
        print(f"  {difference.name}: saved {difference.before}, now {difference.after}; put back")
        parameters[difference.name] = difference.before


if __name__ == "__main__":
    main(*sys.argv[1:])
