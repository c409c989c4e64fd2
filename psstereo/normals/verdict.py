"""What a solver made of each observation; declared in :mod:`psstereo.verdict`, where files can use it too."""

from psstereo.verdict import OUTSIDE, TAKING_PART, Verdict, VerdictArray

__all__ = ["OUTSIDE", "TAKING_PART", "Verdict", "VerdictArray"]
