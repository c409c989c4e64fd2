"""``psstereo calibrate``: where the lights were, how strong, and what the camera did to the light."""

from collections.abc import Callable

import typer

from psstereo_cli.commands.calibrate_balls import calibrate_balls
from psstereo_cli.commands.calibrate_flat import calibrate_flat
from psstereo_cli.commands.calibrate_lamps import calibrate_lamps
from psstereo_cli.commands.calibrate_lens import calibrate_lens
from psstereo_cli.commands.calibrate_matte import calibrate_matte
from psstereo_cli.commands.calibrate_object import calibrate_object
from psstereo_cli.commands.calibrate_response import calibrate_response
from psstereo_cli.commands.calibrate_shape import calibrate_shape
from psstereo_cli.commands.calibrate_sun import calibrate_sun

__all__ = ["CALIBRATIONS", "calibrate"]

CALIBRATIONS: dict[str, Callable[..., None]] = {
    "balls": calibrate_balls,
    "matte": calibrate_matte,
    "lamps": calibrate_lamps,
    "shape": calibrate_shape,
    "object": calibrate_object,
    "sun": calibrate_sun,
    "response": calibrate_response,
    "flat": calibrate_flat,
    "lens": calibrate_lens,
}
"""What can be calibrated, and by what."""

calibrate = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Find lights and camera from targets, from the object itself, or from the clock; keep them in a rig file.\n\n"
    "Example: `psstereo calibrate balls chrome -o rig.toml`, then\n"
    "`psstereo reconstruct photos -o result --rig rig.toml`",
)

for _name, _command in CALIBRATIONS.items():
    calibrate.command(_name)(_command)
