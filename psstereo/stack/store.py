"""Where samples wait for the solver: in memory, or in a temporary file when memory is short."""

import tempfile
from abc import ABC, abstractmethod
from threading import Lock
from types import TracebackType
from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["MemoryStore", "SampleStore", "SpillStore"]


class SampleStore(ABC):
    """Samples (k, m, p): k values an observation, m images, p pixels. A context manager that frees what it holds.

    Attributes
    ----------
    shape : (int, int, int)
        (k, m, p).
    """

    shape: tuple[int, int, int]

    @abstractmethod
    def rows(self, image: int) -> FloatArray | None:
        """Return the place of one image's samples (k, p), to be filled; None if :meth:`write` has to be used."""

    @abstractmethod
    def write(self, image: int, samples: FloatArray) -> None:
        """Put the samples (k, p) of one image; safe from several threads at once."""

    @abstractmethod
    def read(self, start: int, stop: int) -> FloatArray:
        """Return the samples (k, m, stop − start) of a range of pixels; they may be a view."""

    def __enter__(self) -> "SampleStore":
        return self

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the samples."""


class MemoryStore(SampleStore):
    """All samples in one array.

    Parameters
    ----------
    shape : (int, int, int)
        (k, m, p).
    dtype : numpy dtype
        float32 or float64.
    """

    def __init__(self, shape: tuple[int, int, int], dtype: np.dtype[Any]) -> None:
        self.shape = shape
        self._values: FloatArray = np.zeros(shape, dtype)

    def rows(self, image: int) -> FloatArray | None:
        """Return a view; see :meth:`SampleStore.rows`."""
        return self._values[:, image]

    def write(self, image: int, samples: FloatArray) -> None:
        """Copy the samples into their rows; see :meth:`SampleStore.write`."""
        self._values[:, image] = samples

    def read(self, start: int, stop: int) -> FloatArray:
        """Return a view; see :meth:`SampleStore.read`."""
        return self._values[:, :, start:stop]

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        del self._values


class SpillStore(SampleStore):
    """All samples in a temporary file, row after row.

    Decoding an image again for every tile would cost more than writing its samples once and reading them back. The file
    is read and written rather than mapped, so that its pages do not count as the process's memory.

    Parameters
    ----------
    shape : (int, int, int)
        (k, m, p).
    dtype : numpy dtype
        float32 or float64.

    Raises
    ------
    InputError
        If the folder for temporary files has no room.
    """

    def __init__(self, shape: tuple[int, int, int], dtype: np.dtype[Any]) -> None:
        self.shape = shape
        self._dtype = dtype
        self._lock = Lock()
        self._file = tempfile.TemporaryFile(prefix="psstereo-samples-")  # noqa: SIM115 closed by __exit__

    def _offset(self, value: int, image: int, pixel: int) -> int:
        return ((value * self.shape[1] + image) * self.shape[2] + pixel) * self._dtype.itemsize

    def rows(self, image: int) -> FloatArray | None:
        """Return None: the samples go through :meth:`write`."""
        del image
        return None

    def write(self, image: int, samples: FloatArray) -> None:
        """Write the samples to their rows in the file; see :meth:`SampleStore.write`."""
        try:
            with self._lock:
                for k in range(self.shape[0]):
                    self._file.seek(self._offset(k, image, 0))
                    self._file.write(np.ascontiguousarray(samples[k], self._dtype).data)
        except OSError as error:
            raise InputError(
                given=f"The temporary file in {tempfile.gettempdir()} cannot be written ({error.strerror or error}).",
                needed=f"Little memory needs {np.prod(self.shape) * self._dtype.itemsize / 1e6:.0f} MB of room there.",
                remedy="Free some room, set TMPDIR to another folder, or allow more memory.",
            ) from None

    def read(self, start: int, stop: int) -> FloatArray:
        """Read one range of every row; see :meth:`SampleStore.read`."""
        out = np.zeros((*self.shape[:2], stop - start), self._dtype)
        with self._lock:
            for k in range(self.shape[0]):
                for i in range(self.shape[1]):
                    self._file.seek(self._offset(k, i, start))
                    self._file.readinto(out[k, i].data)
        return out

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
