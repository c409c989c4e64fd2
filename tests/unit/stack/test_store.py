from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.stack import MemoryStore, SpillStore
from psstereo.stack import store as store_module


@pytest.mark.parametrize("kind", [MemoryStore, SpillStore])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_written_is_read(kind, dtype):
    values = np.random.default_rng(0).normal(size=(3, 20, 5000)).astype(dtype)
    values[1, 3, 7] = np.nan
    with kind(values.shape, np.dtype(dtype)) as store, ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda i: store.write(i, values[:, i]), reversed(range(20))))
        for start, stop in [(0, 5000), (0, 1), (4999, 5000), (2048, 4096), (17, 17)]:
            part = store.read(start, stop)
            assert part.dtype == dtype
            assert part.tobytes() == values[:, :, start:stop].tobytes()
        parts = list(pool.map(lambda s: store.read(s, s + 500).copy(), range(0, 5000, 500)))
        assert np.concatenate(parts, axis=2).tobytes() == values.tobytes()


def test_a_temporary_file_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr(store_module.tempfile, "tempdir", str(tmp_path))
    with SpillStore((1, 2, 3), np.dtype(np.float32)) as store:
        store.write(0, np.ones((1, 3)))
        assert store.read(0, 3)[0, 0].tolist() == [1.0, 1.0, 1.0]
    with pytest.raises(ValueError, match="closed file"):
        store.read(0, 3)
    assert list(tmp_path.iterdir()) == []


def test_no_room_is_told(monkeypatch):
    class Full:
        def seek(self, _offset):
            pass

        def write(self, _data):
            raise OSError(28, "No space left on device")

    store = SpillStore((1, 2, 250_000), np.dtype(np.float32))
    store._file.close()
    store._file = Full()
    with pytest.raises(InputError, match="No space left") as caught:
        store.write(0, np.ones((1, 250_000)))
    assert "2 MB" in caught.value.needed
