"""What a surface is made of: a reflectance model, and an albedo that may vary over it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from psstereo.brdf import Brdf, Lambert
from psstereo.errors import OptionError
from psstereo.types import FloatArray
from psstereo_synth.patterns import Constant, Pattern

__all__ = ["Material"]

_DIFFUSE = ("albedo", "diffuse")
"""What models call the albedo of their diffuse part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """A reflectance model with a pattern for its albedo.

    Attributes
    ----------
    model : type of Brdf, or Brdf
        Model that takes `parameters`, and `albedo` if it has a diffuse part; or a finished reflectance, the same
        everywhere.
    parameters : mapping
        The model's other parameters.
    albedo : Pattern
        Albedo πρ of the diffuse part over the surface [1].

    Raises
    ------
    OptionError
        If a finished reflectance is given parameters.
    """

    model: type[Brdf] | Brdf = Lambert
    parameters: Mapping[str, Any] = field(default_factory=dict)
    albedo: Pattern = field(default_factory=lambda: Constant(albedo=[0.7]))

    def __post_init__(self) -> None:
        if isinstance(self.model, Brdf) and self.parameters:
            raise OptionError(
                given=f"The {self.model.name} reflectance is finished and is given {', '.join(self.parameters)} too.",
                needed="Parameters belong to a model.",
                remedy="Take them out.",
            )

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.model.name

    @property
    def constant(self) -> bool:
        """Whether the surface is matte."""
        return self.model.constant

    @property
    def diffuse_field(self) -> str | None:
        """Name of the model's parameter that the pattern fills, None if it has no diffuse part."""
        names = {f.name for f in fields(self.model)} if isinstance(self.model, type) else set()
        return next((name for name in _DIFFUSE if name in names), None)

    def brdf(self, points: FloatArray) -> Brdf:
        """Return the reflectance at points (p, 3), as maps with a row for each."""
        if isinstance(self.model, Brdf):
            return self.model
        parameters = dict(self.parameters)
        if self.diffuse_field is not None:
            parameters[self.diffuse_field] = self.albedo.evaluate(points)
        return self.model(**parameters)
