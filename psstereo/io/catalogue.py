"""Every reader, by name; where several recognise a folder the first in this order reads it."""

from psstereo.io.diligent import Diligent
from psstereo.io.reader import Reader

__all__ = ["READERS"]

READERS: dict[str, Reader] = {reader.name: reader for reader in (Diligent(),)}
