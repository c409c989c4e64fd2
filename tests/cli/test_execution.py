"""Execution: what the command asks of the C library, and sizes as people write them."""

import ctypes
import platform

import pytest

from psstereo.errors import OptionError
from psstereo_cli.execution import keep_freed_memory, parse_size


def test_other_c_libraries_are_left_alone(monkeypatch):
    def refuse(*_words):
        raise AssertionError("nothing may be loaded")

    monkeypatch.setattr(platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(ctypes, "CDLL", refuse)
    keep_freed_memory()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt belongs to glibc")
def test_glibc_accepts_what_it_is_asked(monkeypatch):
    answers = []
    load = ctypes.CDLL

    class Library:
        def mallopt(self, option, value):
            answers.append(load(None).mallopt(option, value))

    monkeypatch.setattr(ctypes, "CDLL", lambda _name: Library())
    keep_freed_memory()
    assert answers == [1, 1]


@pytest.mark.parametrize("text", ["0", "0MB", "lots", "-3MB", "1TB", ""])
def test_nonsense_sizes_are_refused(text):
    with pytest.raises(OptionError, match="memory limit"):
        parse_size(text)


def test_little_memory_takes_two_threads_unless_told(run, folder, tmp_path, monkeypatch):
    monkeypatch.setattr("psstereo_cli.execution.available_threads", lambda: 64)
    words = ("reconstruct", folder, "--normals-only", "--max-memory", "30MB")
    assert run(*words, "-o", tmp_path / "two").code == 0
    refused = run(*words, "-o", tmp_path / "many", "--threads", "64")
    assert refused.code == 3
    assert "fewer threads" in refused.text
