"""The matrix of terrain shading: the compiled passes against the readable ones, and both against sparse matrices."""

import numpy as np
import pytest

from psstereo.kernels import terrain_product, terrain_product_compiled
from psstereo.kernels.terrain_product import HALO
from psstereo.sfs.terrain.stencils import Stencils

SHAPE = (11, 9)


def product(module, stencils, tensor, change, splits):
    """Return the product with rows worked on in the given pieces."""
    h, w = stencils.shape
    padded, flow_x, flow_y = np.zeros((3, h + 2 * HALO, w + 2 * HALO))
    padded[HALO:-HALO, HALO:-HALO] = change
    x, y, x_back, y_back = stencils.slope_bands
    out = np.full((h, w), np.nan)
    for first, last in splits:
        module.fill_flows(x, y, *tensor, padded, flow_x, flow_y, first, last)
    for first, last in splits:
        module.gather(x_back, y_back, *stencils.bend_bands, padded, flow_x, flow_y, out, first, last)
    return out


@pytest.mark.parametrize("module", [terrain_product, terrain_product_compiled])
def test_the_product_is_that_of_the_matrices(module):
    rng = np.random.default_rng(3)
    stencils = Stencils(SHAPE, (2.0, 3.0))
    root = rng.normal(size=(2, 2, *SHAPE))
    tensor = (root[0, 0] ** 2 + root[1, 0] ** 2, (root[:, 0] * root[:, 1]).sum(axis=0), (root[:, 1] ** 2).sum(axis=0))
    change, other = rng.normal(size=(2, *SHAPE))
    across, along = stencils.slopes(change)
    wanted = stencils.slopes_back(tensor[0] * across + tensor[1] * along, tensor[1] * across + tensor[2] * along)
    wanted += stencils.bend(change)
    found = product(module, stencils, tensor, change, [(0, 4), (4, 11)])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    again = product(module, stencils, tensor, other, [(0, 11)])
    assert np.sum(found * other) == pytest.approx(np.sum(again * change), rel=1e-12)  # the matrix is symmetric
    assert np.sum(found * change) > 0
