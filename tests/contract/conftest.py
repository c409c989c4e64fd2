"""What the tests of all contracts share."""

import pytest

from psstereo.normals import exemplar


@pytest.fixture(autouse=True)
def _exemplars_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the compiled exemplars for little work too: the readable ones are forty times slower, and held to them."""
    monkeypatch.setattr(exemplar, "_BREAK_EVEN", 0.0)
