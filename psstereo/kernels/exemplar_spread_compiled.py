"""Error bars of the compiled exemplar fit: noise by the steps of its reference, model error by the misfit's."""

from typing import Any

import numba

from psstereo.kernels.exemplar_steps_compiled import fill_residuals, fill_system, minimum
from psstereo.kernels.exemplar_terms import LEAST_SLOPE
from psstereo.kernels.misfit_compiled import misfit

__all__ = ["fill_spread", "tie"]

_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")


@_plain
def tie(d, scale, ties):
    """Fill the weight of each squared amount."""
    for k in range(len(ties)):
        ties[k] = d.ties[k] + d.noise_ties[k] * scale * scale


@_plain
def fill_spread(y, g, x, size, d, dark, scale, work, cell, alike, tell, more, spread, share):
    """Write covariance along the tangents and signed weights; the columns are those of the fit."""
    r, w, sizes, cosine = work.rows[0], work.rows[1], work.rows[2], work.rows[3]
    fill_residuals(y, work.columns, x, size, r)
    count, influence, slope = 0, 0.0, 0.0
    for i in range(len(y)):
        w[i] = 0.0
        if g[i] > 0.0:
            share[i] = 0.0 if r[i] >= 0.0 else -0.0
            if cosine[i] > dark:
                w[i] = g[i]
                v = r[i] * r[i] * g[i] / (scale * scale)
                weight = 1.0 / ((1.0 + v) * (1.0 + v))
                count += 1
                influence += g[i] * (r[i] * weight) ** 2
                slope += (1.0 - 3.0 * v) / (1.0 + v) ** 3
                share[i] = weight if r[i] >= 0.0 else -weight
    tie(d, scale, work.ties)
    fill_system(work.columns, w, y, work.ties, sizes, work.a, work.b)
    unknowns = 2
    for k in range(size + 2):
        work.passive[k] = k >= size or x[k] > 0.0
        unknowns += 1 if k < size and work.passive[k] else 0
    slope /= max(count, 1)
    if count <= unknowns or not slope > LEAST_SLOPE:
        return
    variance = influence / (count - unknowns) / (slope * slope)
    for e in range(2):
        work.b[:] = 0.0
        work.b[size + e] = variance
        if not minimum(work.a, work.b, work.passive, size + 2, work.at, work.small, work.z):
            return
        spread[e], spread[e + 1] = work.z[size], work.z[size + 1]
    if len(cell) == 0:
        return
    for i in range(len(y)):  # residuals as far as they move the fit, in the place of sizes
        sizes[i] = r[i] * abs(share[i]) / slope if w[i] > 0.0 else 0.0
    misfit(work.columns, work.a, work.passive, w, r, sizes, scale, cell, alike, tell, more)
    for e in range(3):
        spread[e] += more[e]
