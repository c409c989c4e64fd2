"""Coarser levels of a multigrid on a pixel grid, compiled: the twin of :mod:`psstereo.kernels.multigrid_setup`."""

from typing import Any

import numba

from psstereo.kernels.multigrid_setup import TIE

__all__ = ["centres", "galerkin", "interpolation"]

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_compile
def _positive(weight: Any) -> Any:
    return weight if weight > 0 else 0 * weight


@_compile
def interpolation(east: Any, south: Any, southeast: Any, southwest: Any, shares: Any, first: int, last: int) -> None:
    """Fill the shares on the lines; see :func:`psstereo.kernels.multigrid_setup.interpolation`."""
    wide, nine = shares.shape[2] - 3, southeast.size > 0
    for k in range(first, last):
        i = 2 * k - 1
        for m in range(1, wide + 1):
            j = 2 * m
            a, b = _positive(east[i, j - 1]), _positive(east[i, j])
            across = _positive(south[i, j]) + _positive(south[i - 1, j])
            if nine:
                a += _positive(southeast[i - 1, j - 1]) + _positive(southwest[i, j])
                b += _positive(southeast[i, j]) + _positive(southwest[i - 1, j + 1])
            sides, total = a + b, a + b + across
            reached = sides > TIE * total
            scale = 1.0 / (sides if reached else 1.0)
            shares[0, k, m] = a * scale if reached else (1.0 if total > 0 else 0.0)
            shares[1, k, m] = b * scale if reached else 0.0
        i = 2 * k
        for m in range(1, wide + 1):
            j = 2 * m - 1
            a, b = _positive(south[i - 1, j]), _positive(south[i, j])
            across = _positive(east[i, j - 1]) + _positive(east[i, j])
            if nine:
                a += _positive(southeast[i - 1, j - 1]) + _positive(southwest[i - 1, j + 1])
                b += _positive(southeast[i, j]) + _positive(southwest[i, j])
            sides, total = a + b, a + b + across
            reached = sides > TIE * total
            scale = 1.0 / (sides if reached else 1.0)
            shares[2, k, m] = a * scale if reached else (1.0 if total > 0 else 0.0)
            shares[3, k, m] = b * scale if reached else 0.0


@_compile
def centres(east: Any, south: Any, southeast: Any, southwest: Any, shares: Any, first: int, last: int) -> None:
    """Fill the shares of the middles; see :func:`psstereo.kernels.multigrid_setup.centres`."""
    wide, nine = shares.shape[2] - 3, southeast.size > 0
    for k in range(first, last):
        i = 2 * k
        for m in range(1, wide + 1):
            j = 2 * m
            n, s = _positive(south[i - 1, j]), _positive(south[i, j])
            w, e = _positive(east[i, j - 1]), _positive(east[i, j])
            a = n * shares[0, k, m] + w * shares[2, k, m]
            b = n * shares[1, k, m] + e * shares[2, k, m + 1]
            c = s * shares[0, k + 1, m] + w * shares[3, k, m]
            d = s * shares[1, k + 1, m] + e * shares[3, k, m + 1]
            total = n + s + w + e
            if nine:
                nw, se = _positive(southeast[i - 1, j - 1]), _positive(southeast[i, j])
                ne, sw = _positive(southwest[i - 1, j + 1]), _positive(southwest[i, j])
                a, b, c, d = a + nw, b + ne, c + sw, d + se
                total += nw + ne + sw + se
            reach = a + b + c + d
            reached = reach > TIE * total
            scale = 1.0 / (reach if reached else 1.0)
            shares[4, k, m] = a * scale if reached else (1.0 if total > 0 else 0.0)
            shares[5, k, m] = b * scale if reached else 0.0
            shares[6, k, m] = c * scale if reached else 0.0
            shares[7, k, m] = d * scale if reached else 0.0


@_compile
def galerkin(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    shares: Any,
    coarse_east: Any,
    coarse_south: Any,
    coarse_southeast: Any,
    coarse_southwest: Any,
    coarse_prior: Any,
    first: int,
    last: int,
) -> None:
    """Add the coarse weights; see :func:`psstereo.kernels.multigrid_setup.galerkin`."""
    wide, nine, held = coarse_east.shape[1] - 3, southeast.size > 0, prior.size > 0
    for k in range(max(first - 1, 1), last):
        i = 2 * k - 1
        own, following = k >= first, k + 1 < last
        for m in range(1, wide + 1):
            j = 2 * m - 1
            # Shares of the pixels at the top, bottom, left and right of the cell in its corners 0 1 / 2 3, and middle.
            t0, t1, b2, b3 = shares[0, k, m], shares[1, k, m], shares[0, k + 1, m], shares[1, k + 1, m]
            l0, l2, r1, r3 = shares[2, k, m], shares[3, k, m], shares[2, k, m + 1], shares[3, k, m + 1]
            c0, c1, c2, c3 = shares[4, k, m], shares[5, k, m], shares[6, k, m], shares[7, k, m]
            none = 0 * c0
            w01 = w02 = w03 = w12 = w13 = w23 = none
            for edge in range(12 if nine else 4):
                if edge == 0:
                    q, d0, d1, d2, d3 = south[i, j + 1], t0 - c0, t1 - c1, -c2, -c3
                elif edge == 1:
                    q, d0, d1, d2, d3 = south[i + 1, j + 1], -c0, -c1, b2 - c2, b3 - c3
                elif edge == 2:
                    q, d0, d1, d2, d3 = east[i + 1, j], l0 - c0, -c1, l2 - c2, -c3
                elif edge == 3:
                    q, d0, d1, d2, d3 = east[i + 1, j + 1], -c0, r1 - c1, -c2, r3 - c3
                elif edge == 4:
                    q, d0, d1, d2, d3 = southeast[i, j], 1 - c0, -c1, -c2, -c3
                elif edge == 5:
                    q, d0, d1, d2, d3 = southeast[i + 1, j + 1], -c0, -c1, -c2, 1 - c3
                elif edge == 6:
                    q, d0, d1, d2, d3 = southwest[i, j + 2], -c0, 1 - c1, -c2, -c3
                elif edge == 7:
                    q, d0, d1, d2, d3 = southwest[i + 1, j + 1], -c0, -c1, 1 - c2, -c3
                elif edge == 8:
                    q, d0, d1, d2, d3 = southeast[i, j + 1], t0, t1 - r1, none, -r3
                elif edge == 9:
                    q, d0, d1, d2, d3 = southeast[i + 1, j], l0, none, l2 - b2, -b3
                elif edge == 10:
                    q, d0, d1, d2, d3 = southwest[i, j + 1], t0 - l0, t1, -l2, none
                else:
                    q, d0, d1, d2, d3 = southwest[i + 1, j + 2], none, r1, -b2, r3 - b3
                w01 -= q * d0 * d1
                w02 -= q * d0 * d2
                w03 -= q * d0 * d3
                w12 -= q * d1 * d2
                w13 -= q * d1 * d3
                w23 -= q * d2 * d3
            w01 += east[i, j] * t1 * (1 - t0) + east[i, j + 1] * t0 * (1 - t1)
            w02 += south[i, j] * l2 * (1 - l0) + south[i + 1, j] * l0 * (1 - l2)
            if held:
                q, g, h = prior[i, j + 1], prior[i + 1, j], prior[i + 1, j + 1]
                w01 -= q * t0 * t1 + h * c0 * c1
                w02 -= g * l0 * l2 + h * c0 * c2
                w03 -= h * c0 * c3
                w12 -= h * c1 * c2
                w13 -= h * c1 * c3
                w23 -= h * c2 * c3
                if own:
                    coarse_prior[k, m] += prior[i, j] + q * t0 + g * l0 + h * c0
                    coarse_prior[k, m + 1] += q * t1 + h * c1
                if following:
                    coarse_prior[k + 1, m] += g * l2 + h * c2
                    coarse_prior[k + 1, m + 1] += h * c3
            if own:
                coarse_east[k, m] += w01
                coarse_south[k, m] += w02
                coarse_south[k, m + 1] += w13
                coarse_southeast[k, m] += w03
                coarse_southwest[k, m + 1] += w12
            if following:
                coarse_east[k + 1, m] += w23
