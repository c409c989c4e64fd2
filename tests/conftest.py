"""Fixtures that all tests share, and how they are shared out among workers."""

import gc
import os
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# The same examples on every run, so that a red run can be repeated and a green one stays green.
# Search for new counterexamples with: pytest --hypothesis-profile=explore
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.load_profile("repeatable")

_ROOT = Path(__file__).resolve().parent.parent

_FIRST = (
    "tests/architecture/test_static_checks.py",
    "tests/unit/kernels/",
    "tests/cli/",
    "tests/bench/",
    "tests/contract/",
    "tests/unit/",
    "tests/reference/",
    "tests/synth/",
    "tests/",
)
"""What is begun first: the longest step, then what compiles, then files in the order of how long one of them takes."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without looking for cycles, and never look at what was collected again.

    Ten thousand tests are there to stay, and looking at them over and over costs a quarter of collecting them.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the long files, so that workers end together, and with compiling, so that later files find it done."""
    ranks = {item.nodeid: next((i for i, n in enumerate(_FIRST) if item.nodeid.startswith(n)), 99) for item in items}
    items.sort(key=lambda item: ranks[item.nodeid])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each worker whole files, in our order, so that what a file prepares or compiles is made once.

    Another ``--dist`` than that of ``-n`` alone stays as it is.
    """
    if config.getoption("dist") != "load":
        return None
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)


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
