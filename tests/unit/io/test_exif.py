from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
import tifffile
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.exif import Exif, exposure_times, read_exif


def photograph(path, *, own=None, sub=None, gps=None):
    tags = Image.Exif()
    tags.update(own or {})
    tags.get_ifd(0x8769).update(sub or {})
    tags.get_ifd(0x8825).update(gps or {})
    Image.new("RGB", (4, 3)).save(path, exif=tags)
    return path


def degrees(*parts):
    return tuple(IFDRational(part) for part in parts)


@pytest.mark.parametrize("ending", ["jpg", "png", "webp"])
def test_what_a_camera_writes(tmp_path, ending):
    path = photograph(
        tmp_path / f"a.{ending}",
        own={0x010F: "Maker", 0x0110: "Model 1"},
        sub={
            0x829A: IFDRational(1, 60),
            0x829D: IFDRational(28, 10),
            0x8827: 200,
            0x9003: "2026:06:21 12:30:15",
            0x9011: "-03:30",
            0x920A: IFDRational(50),
        },
        gps={1: "S", 2: degrees(30, 15, 36), 3: "W", 4: degrees(70, 30, 0), 5: b"\x00", 6: IFDRational(812)},
    )
    found = read_exif(path)
    assert found.exposure == pytest.approx(1 / 60)
    assert (found.f_number, found.iso, found.focal_length, found.camera) == (2.8, 200, 50, "Maker Model 1")
    assert found.taken == datetime(2026, 6, 21, 12, 30, 15, tzinfo=timezone(-timedelta(hours=3, minutes=30)))
    assert found.taken.astimezone(UTC).hour == 16
    assert np.degrees(found.latitude) == pytest.approx(-30.26)
    assert np.degrees(found.longitude) == pytest.approx(-70.5)
    assert found.altitude == 812


def test_tags_in_the_first_directory_as_raw_files_have_them(tmp_path):
    tifffile.imwrite(
        tmp_path / "a.dng", np.zeros((3, 4), np.uint8), extratags=[(33434, "2I", 1, (1, 60), True)], metadata=None
    )
    assert read_exif(tmp_path / "a.dng").exposure == pytest.approx(1 / 60)


def test_what_is_not_there_is_none(tmp_path):
    assert read_exif(photograph(tmp_path / "a.jpg")) == Exif()
    odd = photograph(tmp_path / "b.jpg", sub={0x829A: IFDRational(0, 1), 0x9003: "0000:00:00 00:00:00", 0x8827: 0})
    assert read_exif(odd) == Exif()


def test_exposure_times_take_gain_and_aperture_in(tmp_path):
    paths = tuple(
        photograph(tmp_path / f"{i}.jpg", sub={0x829A: IFDRational(1, t), 0x8827: iso, 0x829D: IFDRational(f)})
        for i, (t, iso, f) in enumerate([(100, 100, 4), (50, 100, 4), (100, 200, 4), (100, 100, 2)])
    )
    np.testing.assert_allclose(exposure_times(paths), [0.01, 0.02, 0.02, 0.04])


def test_what_cannot_be_used_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"a\.jpg does not say"):
        exposure_times((photograph(tmp_path / "a.jpg"),))
    with pytest.raises(MissingFileError):
        read_exif(tmp_path / "none.jpg")
    (tmp_path / "text.jpg").write_text("no photograph")
    with pytest.raises(UnreadableFileError, match="tags"):
        read_exif(tmp_path / "text.jpg")
