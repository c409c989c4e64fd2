"""Sparse Bayesian regression of three unknowns at every pixel: the readable reference.

A pixel's values are ``y_i = q_i·x + e_i`` with errors of unknown variances ``v_i ≥ λ / w_i``: what exceeds the noise
variance λ belongs to shadows, highlights and whatever else is rare. Maximising the probability of the data over the
v_i, with x integrated out under a flat prior, is done by expectation and maximisation on x alone:

* A = Σ q_i q_iᵀ / v_i, x = A⁻¹ Σ q_i y_i / v_i, residuals r_i = y_i − q_i·x;
* v_i = max(λ / w_i, r_i² + q_iᵀ A⁻¹ q_i).

The second term of v_i, the leverage, is the part of the error that x hides; it keeps a sample from locking itself in.
Taking the errors e_i as further unknowns, as the method was published, has the same fixed points but creeps there,
since each round only shrinks v_i by a share. Here the errors are summed out and a round takes 3 × 3 numbers.

λ is given, or taken from the pixel: the variance of which the residuals' lower 35 % speak, read off anew for a number
of rounds and then held. The lit observations are told by the model in these rounds, and then held too; from there on no
round can make the data less probable.
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["BARE", "FAILED", "SETTLED", "UNSETTLED", "iterate"]

SETTLED, UNSETTLED, FAILED, BARE = 0, 1, 2, 3
"""Outcomes of a pixel: converged, not converged, lights coplanar, nothing to see."""

DARK = 0.02
"""Share of the brightest value below which a value starts as shadow, and cosine below which a light is grazing."""

TRIM = (0.15, 0.9)
"""Ranks of the lit values that make the start: highlights are the highest, penumbrae the lowest."""

HOLD = 16
"""Rounds in which gate and noise variance follow the fit."""

ENOUGH = 5
"""Lit observations from which errors can be told from x: with one to spare, any of them can be blamed."""

QUANTILE, DEVIATION = 0.35, 0.45376
"""Share of the residuals that speaks of the noise, and the quantile of |N(0, 1)| there."""

IGNORED = 0.1
"""Weight against that of a perfect observation below which one is all but ignored; 3.2 standard deviations."""

LEAST_SLOPE = 0.25
"""Least mean slope of the influence against the mean weight; where it is smaller the fit is hardly held."""

SINGULAR = 1e-10
"""Pivot over trace below which lights count as coplanar, as in the least-squares fit."""

_Answer = tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray]


def iterate(
    values: FloatArray,
    weights: FloatArray,
    q: FloatArray,
    moments: FloatArray,
    r_inverse: FloatArray,
    shadow: bool,
    noise: float,
    floor: float,
    rounds: int,
    tolerance: float,
) -> _Answer:
    """Fit pixels.

    Parameters
    ----------
    values : float64 array (p, m)
        Brightness, a row a pixel; what is not finite is left out.
    weights : float64 array (p, m) or (0, 0)
        Inverse variances up to a factor; all 1 if empty.
    q : float64 array (3, m)
        Orthonormal rows of the light matrix.
    moments : float64 array (6, m)
        Products of its rows, see :class:`psstereo.normals.moments.RigFactor`.
    r_inverse : float64 array (3, 3)
        From x to the scaled normal.
    shadow : bool
        Whether shadows are left out.
    noise : float
        Standard deviation of the noise as a share of the brightest value; estimated if negative [1].
    floor : float
        Least standard deviation that an estimate may reach, likewise [1].
    rounds : int
        Most rounds.
    tolerance : float
        Relative step of the scaled normal below which a pixel is done [1].

    Returns
    -------
    x : float64 array (p, 3)
        Solution in the basis of q.
    a : float64 array (p, 6)
        Entries 11, 12, 22, 13, 23, 33 of λ A.
    spread : float64 array (p,)
        Variance of the noise as it reaches x, so that the covariance of x is that times (λ A)⁻¹; NaN where unknown.
    counts : int64 array (p, 5)
        Outcome, rounds, usable observations, lit ones, and those of the lit that are not all but ignored.
    shares : float64 array (p, m)
        Weight of each observation against a perfect one, negative for values below the fit; ±2 where not lit, NaN where
        not usable.
    """
    p, m = values.shape
    base = np.ones((p, m)) if weights.size == 0 else np.where(weights > 0, weights, 0.0)
    usable = np.isfinite(values) & (base > 0)
    base = np.where(usable, base, 0.0)
    top = base.max(axis=1, initial=0.0)
    base /= np.where(top > 0, top, 1.0)[:, None]
    peak = np.where(usable, values, 0.0).max(axis=1, initial=0.0)
    y = np.where(usable, values, 0.0) / np.where(peak > 0, peak, 1.0)[:, None]
    fit = _Fit(y, base, usable, q, moments, r_inverse, shadow, noise * noise if noise >= 0 else -1.0, floor * floor)
    fit.outcome[peak <= 0] = BARE
    fit.start()
    for k in range(1, rounds + 1):
        rows = np.flatnonzero(fit.outcome == UNSETTLED)
        if len(rows) == 0:
            break
        fit.round(rows, k, tolerance)
    return fit.answer(peak)


def _solve(a: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return x and A⁻¹ (p, 6) for matrices (p, 6) and right-hand sides (p, 3), and where A is singular."""
    a11, a12, a22, a13, a23, a33 = a.T
    tiny = SINGULAR * (a11 + a22 + a33)
    with np.errstate(all="ignore"):
        l11 = np.sqrt(np.where(a11 > tiny, a11, np.nan))
        l21, l31 = a12 / l11, a13 / l11
        d = a22 - l21 * l21
        l22 = np.sqrt(np.where(d > tiny, d, np.nan))
        l32 = (a23 - l31 * l21) / l22
        d = a33 - l31 * l31 - l32 * l32
        l33 = np.sqrt(np.where(d > tiny, d, np.nan))
        g11, g22, g33 = 1 / l11, 1 / l22, 1 / l33
        g21, g32, g31 = -l21 * g11 * g22, -l32 * g22 * g33, (l21 * l32 * g22 - l31) * g11 * g33
        s = np.stack(
            [
                g11 * g11 + g21 * g21 + g31 * g31,
                g21 * g22 + g31 * g32,
                g22 * g22 + g32 * g32,
                g31 * g33,
                g32 * g33,
                g33 * g33,
            ],
            axis=1,
        )
    b1, b2, b3 = rhs.T
    x1 = s[:, 0] * b1 + s[:, 1] * b2 + s[:, 3] * b3
    x2 = s[:, 1] * b1 + s[:, 2] * b2 + s[:, 4] * b3
    x3 = s[:, 3] * b1 + s[:, 4] * b2 + s[:, 5] * b3
    return np.stack([x1, x2, x3], axis=1), s, ~np.isfinite(g33)


def _ranked(values: FloatArray, chosen: BoolArray) -> FloatArray:
    return np.sort(np.where(chosen, values, np.inf), axis=1)


class _Fit:
    """The state of all pixels between two rounds."""

    def __init__(
        self,
        y: FloatArray,
        base: FloatArray,
        usable: BoolArray,
        q: FloatArray,
        moments: FloatArray,
        r_inverse: FloatArray,
        shadow: bool,
        noise: float,
        floor: float,
    ) -> None:
        self.y, self.base, self.usable = y, base, usable
        self.q, self.moments, self.r_inverse = q, moments, r_inverse
        self.shadow, self.noise, self.floor = shadow, noise, floor
        p = len(y)
        self.x, self.s = np.zeros((p, 3)), np.zeros((p, 6))
        self.lam = np.full(p, noise if noise >= 0 else floor)
        self.lit = usable & (y > DARK) if shadow else usable.copy()
        self.first = self.lit.copy()
        self.held = np.zeros(p, np.bool_)
        self.outcome = np.full(p, UNSETTLED)
        self.taken = np.zeros(p, np.int64)

    def _try(self, rows: IntArray, w: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        r = self.y[rows] - self.x[rows] @ self.q
        return _solve(w @ self.moments.T, (w * r) @ self.q.T)

    def start(self) -> None:
        """Fit the middle ranks; all lit values where these do not span space; all above zero where those do not."""
        rows = np.flatnonzero(self.outcome == UNSETTLED)
        n = self.first[rows].sum(axis=1)
        ranked = _ranked(self.y[rows], self.first[rows])
        last = np.maximum(n - 1, 0)
        low = np.take_along_axis(ranked, np.floor(TRIM[0] * last).astype(np.int64)[:, None], axis=1)
        high = np.take_along_axis(ranked, np.ceil(TRIM[1] * last).astype(np.int64)[:, None], axis=1)
        middle = self.first[rows] & (self.y[rows] >= low) & (self.y[rows] <= high)
        for attempt in range(3):
            if attempt == 2:
                self.first[rows] = self.usable[rows] & (self.y[rows] > 0) if self.shadow else self.usable[rows]
                self.lit[rows] = self.first[rows]
            chosen = middle if attempt == 0 else self.first[rows]
            x, _, singular = self._try(rows, chosen * self.base[rows])
            self.x[rows[~singular]] = x[~singular]
            rows, middle = rows[singular], middle[singular]
        self.outcome[rows] = FAILED

    def round(self, rows: IntArray, k: int, tolerance: float) -> None:
        """Gate, weigh and solve some pixels once."""
        r, predicted = self._residuals(rows)
        if k <= HOLD:
            self._gate(rows, predicted)
            self._estimate(rows, r)
        step, s, singular = self._try(rows, self._weights(rows, r)[0])
        again = singular & (self.lit[rows] != self.first[rows]).any(axis=1)
        back = rows[again]
        self.lit[back], self.held[back] = self.first[back], True
        step[again], s[again], singular[again] = self._try(back, self.lit[back] * self.base[back])
        s[again] = 0.0  # these weights are no inverse variances
        good = rows[~singular]
        self.x[good] += step[~singular]
        self.s[good] = s[~singular]
        self.taken[rows] = k
        size = np.linalg.norm(self.x[good] @ self.r_inverse.T, axis=1)
        small = np.linalg.norm(step[~singular] @ self.r_inverse.T, axis=1) <= tolerance * size
        self.outcome[good[small]] = SETTLED

    def _residuals(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        predicted = self.x[rows] @ self.q
        return self.y[rows] - predicted, predicted

    def _gate(self, rows: IntArray, predicted: FloatArray) -> None:
        if not self.shadow:
            return
        threshold = DARK * np.linalg.norm(self.x[rows] @ self.r_inverse.T, axis=1)
        lit = self.usable[rows] & (predicted > threshold[:, None])
        few = lit.sum(axis=1) < 3
        self.held[rows[few]] = True
        held = self.held[rows]
        lit[held] = self.first[rows[held]]
        self.lit[rows] = lit

    def _estimate(self, rows: IntArray, r: FloatArray) -> None:
        if self.noise >= 0:
            return
        n = self.lit[rows].sum(axis=1)
        ranked = _ranked(np.abs(r) * np.sqrt(self.base[rows]), self.lit[rows])
        # three of the residuals are small because x is fitted to them
        index = np.where(n >= ENOUGH, (QUANTILE * np.maximum(n - 3, 0)).astype(np.int64) + 2, 0)
        at = np.take_along_axis(ranked, index[:, None], axis=1)[:, 0] / DEVIATION
        self.lam[rows] = np.where(n >= ENOUGH, np.maximum(self.floor, at * at), self.floor)

    def _weights(self, rows: IntArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the weights 1 / v, and the leverages."""
        double = self.s[rows] * [1.0, 2.0, 1.0, 2.0, 2.0, 1.0]
        leverage = double @ self.moments
        base, lit = self.base[rows], self.lit[rows]
        lam = self.lam[rows][:, None]
        plain = (lit.sum(axis=1) < ENOUGH)[:, None]
        with np.errstate(divide="ignore"):
            w = base / np.where(plain, lam, np.maximum(lam, base * (r * r + leverage)))
        return np.where(lit, w, 0.0), leverage

    def answer(self, peak: FloatArray) -> _Answer:
        """Return what :func:`iterate` promises."""
        rows = np.arange(len(self.x))
        r, _ = self._residuals(rows)
        w, leverage = self._weights(rows, r)
        lam = self.lam
        per = np.where(self.lit, self.base, 1.0) / lam[:, None]  # from residuals to units of the noise
        share = np.where(self.lit, w / per, 0.0)
        n = self.lit.sum(axis=1)
        # influence ψ = share · t of a residual t, and its slope, negative where an observation is being written off
        t2 = r * r * per
        slope = np.where((share < 1) & (n >= ENOUGH)[:, None], share * share * (leverage * per - t2), share)
        total = share.sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            keeping = np.maximum(slope.sum(axis=1) / total, LEAST_SLOPE)
            freedom = np.where(total > 3, total - 3, np.nan)
            spread = lam * (share * share * t2).sum(axis=1) / (keeping * keeping * freedom)
        lost = self.outcome >= FAILED
        spread = np.where(lost, np.nan, spread * peak * peak)
        counted = (share >= IGNORED).sum(axis=1)
        shares = np.where(self.lit, np.where(r < 0, -share, share), np.where(r < 0, -2.0, 2.0))
        shares[~self.usable] = np.nan
        counts = np.stack([self.outcome, self.taken, self.usable.sum(axis=1), n, counted], axis=1)
        x = np.where(lost[:, None], np.nan, self.x * peak[:, None])
        return x, (w * lam[:, None]) @ self.moments.T, spread, counts.astype(np.int64), shares
