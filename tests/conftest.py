"""Fixtures that all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples on every run, so that a red run can be repeated and a green one stays green.
# Search for new counterexamples with: pytest --hypothesis-profile=explore
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.load_profile("repeatable")

_ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real captures: PSSTEREO_DATA, or ../shared/data beside the repository; skips without one."""
    given = os.environ.get("PSSTEREO_DATA")
    folder = Path(given) if given else _ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"the real captures are not at {folder}; set PSSTEREO_DATA")
    return folder
