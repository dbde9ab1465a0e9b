"""Raw inertial messages of NovAtel receivers in ASCII: RAWIMU, RAWIMUS, RAWIMUX and RAWIMUSX."""

import re
import zlib
from pathlib import Path

import numpy as np

from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import Header

_MESSAGE = re.compile(r"[#%](RAWIMUS?X?A,[^*]*)\*([0-9a-fA-F]{8})")
_WEEK = 604800.0  # s
_ALL = 0xFFFFFFFF


def read(about: Header) -> Rows:
    """Read counts of all such messages of a file; other messages are passed over.

    The last fields of each are week, second, status, and counts of the accelerometers z, -y, x and
    of the gyros z, -y, x (OEM7 Commands and Logs Reference Manual, RAWIMUSX).
    """
    path = about.data[0]
    values = []
    for number, line in enumerate(Path(path).read_text(encoding="ascii").splitlines(), 1):
        found = _MESSAGE.match(line)
        if found is None:
            if line[1:7] == "RAWIMU":
                raise DataError(f"{path}: line {number}: cut short")
            continue
        text, said = found.groups()
        if zlib.crc32(text.encode(), _ALL) ^ _ALL != int(said, 16):
            raise DataError(f"{path}: line {number}: its checksum is not that of what it says")
        fields = text.split(";")[1].split(",")
        values.append([*fields[-9:-7], *fields[-6:]])
    if not values:
        raise DataError(f"{path}: no message RAWIMU, RAWIMUS, RAWIMUX or RAWIMUSX")
    week, second, *six = np.array(values, dtype=float).T
    az, ay, ax, gz, gy, gx = six
    time = _WEEK * (week - week[0]) + second
    return Rows(time, np.stack([gx, -gy, gz], axis=1), np.stack([ax, -ay, az], axis=1))
