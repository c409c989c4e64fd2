import pytest

from psstereo.camera import CAMERAS
from psstereo.catalogue import choose
from psstereo.depth import INTEGRATORS
from psstereo.errors import OptionError
from psstereo.lights import LIGHTS
from psstereo.normals import NORMAL_SOLVERS


@pytest.mark.parametrize("catalogue", [CAMERAS, LIGHTS, NORMAL_SOLVERS, INTEGRATORS])
def test_members_bear_their_own_names(catalogue):
    assert catalogue
    for name, member in catalogue.items():
        assert member.name == name
        assert choose(catalogue, name, "member") is member


def test_an_unknown_name_offers_the_nearest():
    family = {"least-squares": 1, "robust": 2}
    with pytest.raises(OptionError) as caught:
        choose(family, "least-square", "solver")
    assert caught.value.given == "The solver 'least-square' is unknown."
    assert caught.value.needed == "Known are least-squares, robust."
    assert caught.value.remedy == "Did you mean least-squares?"
    with pytest.raises(OptionError, match="Choose one of them"):
        choose(family, "xyz", "solver")
