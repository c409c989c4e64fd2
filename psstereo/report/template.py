"""Templates of pages: they escape what they are given, and refuse what they are not given."""

from importlib.resources import files

__all__ = ["filled"]


def filled(name: str, /, *, package: str = "psstereo.report", **values: object) -> str:
    """Fill a template.

    Parameters
    ----------
    name : str
        File of the template.
    package : str
        Where it lies; what it includes may lie beside it or beside this module.
    values : object
        What it shows.

    Returns
    -------
    str
        The page.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def read(wanted: str) -> str | None:
        for place in (package, "psstereo.report"):
            found = files(place).joinpath(wanted)
            if found.is_file():
                return found.read_text(encoding="utf-8")
        return None

    environment = Environment(autoescape=True, undefined=StrictUndefined, loader=FunctionLoader(read))
    return environment.get_template(name).render(**values)
