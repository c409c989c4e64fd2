"""OpenEXR files that end too early."""

import numpy as np
import pytest

from psstereo.errors import MissingFileError, UnreadableFileError
from psstereo.stack.exr_whole import require_whole_exr


def write(path, compression, height=70, **header):
    import OpenEXR

    values = np.random.default_rng(1).normal(size=(height, 9)).astype(np.float32)
    header = {"compression": compression, "type": OpenEXR.scanlineimage, **header}
    with OpenEXR.File(header, {"Y": values}) as file:
        file.write(str(path))


def test_whole_files_of_every_compression_pass_and_cut_ones_do_not(tmp_path):
    import OpenEXR

    names = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA", "DWAB")
    for name in names:
        path = tmp_path / f"{name} é.exr"
        write(path, getattr(OpenEXR, f"{name}_COMPRESSION"))
        require_whole_exr(path)
        content = path.read_bytes()
        for length in (len(content) - 1, len(content) // 2, 400, 60, 9, 6, 1):
            path.write_bytes(content[:length])
            with pytest.raises(UnreadableFileError, match="ends before"):
                require_whole_exr(path)


def test_other_files_are_refused(tmp_path):
    for content in (b"\x89PNG\r\n\x1a\n" + bytes(100), b""):
        (tmp_path / "a.exr").write_bytes(content)
        with pytest.raises(UnreadableFileError):
            require_whole_exr(tmp_path / "a.exr")
    with pytest.raises(MissingFileError):
        require_whole_exr(tmp_path / "none.exr")
