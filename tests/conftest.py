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

_COMPILING = ("tests/unit/kernels/",)
"""What calls nearly every compiled loop."""
_PLAIN = (
    "tests/architecture/",
    "tests/synth/",
    *(f"tests/contract/test_{name}.py" for name in ("brdf", "camera", "fault", "light", "reader", "relief", "stack")),
    *(f"tests/unit/{name}/" for name in ("brdf", "forward", "io", "lights", "metrics", "radiometry", "stack")),
)
"""What hardly calls any."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let one worker compile, where nothing is compiled yet, while others are at what needs no compiled loop.

    pytest-xdist gives each worker a run of neighbours to begin with. In the order of folders all of them would arrive
    at the first compiled loops at about the same time, and compile the same.
    """
    items.sort(key=lambda item: 0 if item.nodeid.startswith(_COMPILING) else 1 if item.nodeid.startswith(_PLAIN) else 2)


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep what is remembered of the machine's speed away from the user's own."""
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real captures: PSSTEREO_DATA, or ../shared/data beside the repository; skips without one."""
    given = os.environ.get("PSSTEREO_DATA")
    folder = Path(given) if given else _ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"the real captures are not at {folder}; set PSSTEREO_DATA")
    return folder
