"""The interface of stages: each is done or left out, with a reason and a figure."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options

__all__ = ["Decision", "Skip", "Stage", "Use", "refuse"]


@dataclass(frozen=True, kw_only=True)
class Use:
    """A stage is done.

    Attributes
    ----------
    reason : str
        Why, as a sentence.
    figure : str
        The number that it rests on; empty if it rests on none.
    options : mapping
        How, as plain values.
    """

    reason: str
    figure: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Skip:
    """A stage is left out.

    Attributes
    ----------
    reason : str
        Why, as a sentence.
    figure : str
        The number that it rests on; empty if it rests on none.
    """

    reason: str
    figure: str = ""


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was decided about a stage.

    Attributes
    ----------
    stage : str
        Its name.
    use : bool
        Whether it is done.
    reason : str
        Why, as a sentence.
    figure : str
        The number that it rests on.
    options : mapping
        How, as plain values.
    """

    stage: str
    use: bool
    reason: str = ""
    figure: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


class Stage(ABC):
    """A piece of work that a capture may need or not.

    Attributes
    ----------
    name : str
        Its name, in plans and in the record of a run.
    summary : str
        What it does, as a clause.
    keys : tuple of str
        Options that it knows.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    keys: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def decide(self, facts: Facts) -> Use | Skip:
        """Decide by the facts alone."""

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return what somebody asked for, None if nobody did."""
        del options, facts
        return None

    def whole(self, facts: Facts) -> Use | Skip:
        """Decide for a run that leaves nothing out which can be done at all."""
        return self.decide(facts)

    @abstractmethod
    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Return the capture and the options that a run with this decision has.

        Raises
        ------
        InputError, OptionError
            If the decision does not fit the capture, as when a plan was made for another one or edited wrongly.
        """


def refuse(stage: Stage, given: str, remedy: str = "Change it back, or make the plan anew.") -> InputError:
    """Return the error of a decision that cannot be followed."""
    return InputError(
        given=f"The plan's stage {stage.name}: {given}",
        needed="Each stage of a plan must fit the capture and the other stages.",
        remedy=remedy,
    )
