"""Reading images into samples."""

from dataclasses import replace
from typing import Any, ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["ReadingImages"]


class ReadingImages(Stage):
    """Decodes every image once and keeps the pixels under the mask."""

    name: ClassVar[str] = "reading"
    summary: ClassVar[str] = "decode every image once"
    keys: ClassVar[tuple[str, ...]] = ("gray", "clip")

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it always; see :meth:`Stage.decide`."""
        return Use(reason=f"{facts.images} images.", figure=f"{facts.pixels} pixels")

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return another gray value or a bound on brightness; see :meth:`Stage.asked`."""
        gray = options.gray if isinstance(options.gray, str) else [float(one) for one in options.gray]
        asked: dict[str, Any] = {} if gray == "mean" else {"gray": gray}
        if options.clip is not None:
            asked["clip"] = options.clip
        return replace(_used(self.decide(facts)), options=asked) if asked else None

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set both; see :meth:`Stage.apply`."""
        if not decision.use:
            raise refuse(self, "it is left out.")
        gray, clip = decision.options.get("gray", "mean"), decision.options.get("clip")
        numbers = isinstance(gray, list) and all(isinstance(one, int | float) for one in gray)
        if not (isinstance(gray, str) or numbers):
            raise refuse(self, f"its gray value is {gray!r}.", "Use a name, or a list of one weight a channel.")
        if clip is not None and (isinstance(clip, bool) or not isinstance(clip, int | float) or not clip > 0):
            raise refuse(self, f"its clip is {clip!r}.", "Use a number above 0.")
        return capture, replace(options, gray=gray if isinstance(gray, str) else tuple(gray), clip=clip)


def _used(found: Use | Skip) -> Use:
    assert isinstance(found, Use)
    return found
