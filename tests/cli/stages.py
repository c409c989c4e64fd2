"""What a command reports of its progress, without a terminal."""

from contextlib import contextmanager

from psstereo_cli import console


class Stages:
    """Take the place of the bars, and keep what they would have shown."""

    def __init__(self, monkeypatch):
        self.seen = {}
        monkeypatch.setattr(console, "progress_bars", self._bars)

    @contextmanager
    def _bars(self):
        yield self

    def __call__(self, stage, done, total, /):
        assert 0 <= done <= total
        self.seen.setdefault(stage, []).append((done, total))

    def ended(self):
        """Return the stages in their order; each must have been told more than once, up to its end."""
        for stage, told in self.seen.items():
            assert len(told) > 1, stage
            assert told[-1][0] == told[-1][1], stage
        return list(self.seen)
