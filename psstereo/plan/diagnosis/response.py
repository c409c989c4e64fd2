"""A tone curve that was not undone."""

from typing import ClassVar, Literal

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["ResponseLeft"]


class ResponseLeft(Check):
    """Gamma, by how brightness bends against the shading that the other lights tell; it needs four lights."""

    name: ClassVar[str] = "response"
    summary: ClassVar[str] = "The images look gamma-encoded: brightness is not proportional to light."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if a curve explains much of the misfit; see :meth:`Check.look`."""
        found = case.tone
        if found is None:
            return None
        sentence = (
            f"Brightness bends as if the images were encoded with a gamma of {found.exponent:.2f} ± {found.error:.2f}; "
            f"that explains {found.share:.0%} of the misfit."
        )
        word = "srgb" if 1.9 < found.exponent < 2.6 else f"{found.exponent:.1f}"
        remedy = f'Say response = "{word}" in the section [images] of capture.toml, or save linear images.'
        return self.finding("fault", (found.exponent, ""), (sentence, remedy), min(0.95, 0.5 + found.share / 2))
