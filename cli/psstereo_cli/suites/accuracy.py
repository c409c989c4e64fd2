"""Suite accuracy: error and time of the gates on scenes with known truth."""

from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Map, Progress

__all__ = ["accuracy"]


def accuracy(
    repeats: int, size: str | None, _lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run the gates on scenes from easy to hard."""
    from psstereo.bench import run_solvers
    from psstereo.errors import OptionError
    from psstereo.normals import GATES, LeastSquares
    from psstereo_synth.problems import lambertian_problems

    width, height = dimensions(size or "256x256")
    if width != height:
        raise OptionError(
            given=f"The size is {size!r}.", needed="The scenes of accuracy are squares.", remedy=f"Say {width}x{width}."
        )
    methods = {f"least-squares, {name}": LeastSquares(gate=GATES[name]) for name in ("none", "auto")}
    problems = lambertian_problems(width)
    records = run_solvers("accuracy", problems, methods, repeats=repeats, over=over, progress=progress)
    return records, "least-squares, none", {}
