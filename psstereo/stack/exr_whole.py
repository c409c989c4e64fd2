"""Whether an OpenEXR file is whole, told before the decoder, which writes to the process's streams when it is not."""

import struct
from pathlib import Path

import numpy as np

from psstereo.errors import UnreadableFileError
from psstereo.stack.decode import read_bytes
from psstereo.types import Array

__all__ = ["require_whole_exr"]

_MAGIC = 20000630
_PARTS_TILES_DEEP = 0x200 | 0x800 | 0x1000
_LINES = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
"""Lines in a chunk, by the number of the compression."""


def require_whole_exr(path: Path) -> None:
    """Refuse an OpenEXR file of scan lines that ends too early.

    The table of chunks at the head of the file says where each begins, and each chunk how long it is. Files of tiles,
    of several parts and of deep pixels are left to the decoder, and so are compressions that are not known here.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    MissingFileError
        If it is not there.
    UnreadableFileError
        If it is no OpenEXR file, or not whole.
    """
    data = read_bytes(path)
    try:
        whole = _is_whole(data)
    except (struct.error, ValueError, IndexError):
        whole = False
    if not whole:
        raise UnreadableFileError(
            given=f"The file {path} is no OpenEXR file, or ends before its last line.",
            needed="A whole file.",
            remedy="Copy or export it again.",
        )


def _is_whole(data: Array) -> bool:
    content = data.tobytes()
    magic, version = struct.unpack_from("<iI", content, 0)
    if magic != _MAGIC:
        return False
    if version & _PARTS_TILES_DEEP:
        return True
    compression, window, position = _header(content)
    lines = _LINES.get(compression)
    if lines is None:
        return True
    chunks = -(-(window[3] - window[1] + 1) // lines)
    table = np.frombuffer(content, "<u8", chunks, position)
    begin, end = position + 8 * chunks, len(content)
    for offset in table.tolist():
        if not begin <= offset <= end - 8:
            return False
        _, size = struct.unpack_from("<iI", content, offset)
        if offset + 8 + size > end:
            return False
    return True


def _header(content: bytes) -> tuple[int, tuple[int, int, int, int], int]:
    """Return compression, data window and where the table of chunks begins."""
    position, found = 8, {}
    while content[position] != 0:
        name_end = content.index(b"\0", position)
        kind_end = content.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<I", content, kind_end + 1)
        found[content[position:name_end]] = kind_end + 5
        position = kind_end + 5 + size
    window = struct.unpack_from("<4i", content, found.get(b"dataWindow", len(content)))
    return content[found.get(b"compression", len(content))], window, position + 1
