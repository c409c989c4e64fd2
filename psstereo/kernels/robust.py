"""Robust regression of three unknowns at every pixel: the readable reference.

Each pixel solves ``min Σ_i g_i ρ_s(y_i − q_i·x)`` over the lights that its own fit sees as lit, q_i the rows of the
orthonormal factor of the light matrix. The steps are these.

1. **Start.** Least squares over the observations whose brightness has a rank from `low` to `high` among those that are
   not dark against the brightest: shadows are below, highlights above.
2. **Rounds** of iteratively reweighted least squares with the chosen loss. The scale s is first the median residual of
   the lit observations, then follows the weights: ``s² = Σ w r² / (c Σ w)``, with c such that s is the standard
   deviation of Gaussian residuals. Under a redescending loss it shrinks to the floor where most residuals pile up at
   zero, and stays where they do not. Where this goes back and forth, what is lit and the scale are held in the end.
3. **What is left over**, when the loss is to be chosen (`ADAPTIVE`). Three things are told apart by the residuals of a
   Geman–McClure fit and, where they are not small, of a fit with Tukey's loss from there, pixel by pixel:

   * white: neighbouring lights have unrelated residuals. They are noise, so Tukey's loss takes over with the scale
     frozen; it uses nearly all that the data hold.
   * structured, but piled up at zero: a matte surface with highlights or cast shadows. The first fit stands.
   * structured and spread out: the surface is not matte. The fit is repeated over the middle ranks of brightness
     (`middle` ± half of `width`), where reflectance is closest to Lambert's law, and highlights and shadows are not.

   Structure is Moran's statistic [1]_ of the residuals within four scales, between each light and its nearest
   neighbours on the dome: about 0 for noise, toward 1 for a smooth error of the model.
4. **Polish.** One weighted solution with the final weights in double precision.
5. **Error.** The variance comes from the influence of the residuals [2]_. Where few observations agree no better than
   the luckiest choice among noise would (an a-contrario test [3]_), it is that of least squares and a little more.

Quantiles are found by bisection, which compares whole rows at a time; twelve steps are 1/4096 of the range.

References
----------
.. [1] P. A. P. Moran, "Notes on continuous stochastic phenomena", Biometrika 37, 17-23, 1950. doi:10.2307/2332142
.. [2] P. J. Huber, E. M. Ronchetti, "Robust Statistics", 2nd ed., Wiley, 2009. doi:10.1002/9780470434697
.. [3] L. Moisan, B. Stival, "A probabilistic criterion to detect rigid point matches between two images and estimate
   the fundamental matrix", Int. J. Comput. Vis. 57, 201-218, 2004. doi:10.1023/B:VISI.0000013094.38752.54
"""

import numpy as np

from psstereo.kernels.robust_losses import weight, weight_slope
from psstereo.kernels.robust_settings import (
    ADAPTIVE,
    CONSISTENCY,
    FEW,
    LOG_CHANCE,
    LOSS_OF_FEW,
    LOSSES,
    MAD,
    MORE,
    QUARTILE,
    Kind,
    RobustFit,
    Settings,
)
from psstereo.types import Array, BoolArray, FloatArray, IntArray
from psstereo.verdict import Verdict

__all__ = ["robust_fit"]

_GEMAN_MCCLURE, _TUKEY = 3, 4


def robust_fit(
    values: FloatArray,
    weights: FloatArray | None,
    q: FloatArray,
    r_inverse: FloatArray,
    neighbours: IntArray,
    settings: Settings,
    verdicts: bool,
) -> RobustFit:
    """Solve some pixels.

    Parameters
    ----------
    values : float array (m, p)
        Brightness over light strength, NaN where not usable.
    weights : float array (m, p) or None
        Weights of the observations; zero leaves one out.
    q : float64 array (m, 3)
        Orthonormal factor of the light matrix.
    r_inverse : float64 array (3, 3)
        Inverse of its triangular factor.
    neighbours : uint32 array (3, k)
        Pairs of a light and one that is near it, and how often each counts.
    settings : Settings
        How.
    verdicts : bool
        Whether to judge each observation.

    Returns
    -------
    RobustFit
        What was found.
    """
    return _Pixels(values, weights, q, r_inverse, neighbours, settings).solve(verdicts)


class _Pixels:
    """All pixels of a block side by side; arrays are (m, p) or (p,)."""

    def __init__(
        self,
        values: FloatArray,
        weights: FloatArray | None,
        q: FloatArray,
        r_inverse: FloatArray,
        neighbours: IntArray,
        settings: Settings,
    ) -> None:
        given = np.asarray(values, np.float64)
        usable = np.isfinite(given)
        if weights is not None:
            usable &= weights > 0
        self.usable = usable.sum(axis=0)
        raw = np.where(usable, given, 0.0)
        self.brightest = raw.max(axis=0)
        self.fit_at_all = (self.usable >= 3) & (self.brightest > 0)
        self.y = raw / np.where(self.fit_at_all, self.brightest, 1.0)
        g = usable.astype(np.float64) if weights is None else np.where(usable, weights, 0.0)
        self.g = g / np.maximum(g.max(axis=0), 1e-300)
        self.q, self.r_inverse, self.neighbours, self.s = q, r_inverse, neighbours, settings
        self.broken = np.zeros(len(self.brightest), np.bool_)  # too little was left of them, or they do not settle

    def solve(self, verdicts: bool) -> RobustFit:
        """Go through the steps of the module's description."""
        s, y, g = self.s, self.y, self.g
        adaptive = s.loss == ADAPTIVE
        first = _GEMAN_MCCLURE if adaptive else s.loss
        tuning = LOSSES["geman-mcclure"] if adaptive else s.tuning
        mass = g.sum(axis=0)
        bright = g * (y >= s.dark)
        high = _quantile(y, bright, np.ones_like(mass), s.high * bright.sum(axis=0), 8)
        low = _quantile(y, bright, np.ones_like(mass), s.low * bright.sum(axis=0), 8)
        x, ok = self._start(bright * ((y >= low - 4e-3) & (y <= high)))
        ok &= self.fit_at_all
        floor = s.floor * high
        scale = np.maximum(self._by_quantile(x, g, 0.5, 8) * MAD, floor)
        given = s.scale / np.where(self.brightest > 0, self.brightest, 1.0)
        scale = given if s.scale > 0 else scale
        lit = np.count_nonzero(self._lit(x, g), axis=0)
        plain = self.fit_at_all & (np.minimum(lit, np.count_nonzero(bright, axis=0)) < s.least)
        ok |= plain
        gate, loss, factor = g.copy(), np.full(len(mass), first), np.full(len(mass), tuning)
        kind = np.where(plain, Kind.PLAIN, Kind.PILED_UP if adaptive else Kind.WHITE)
        todo = ok & ~plain
        self._iterate(todo, first, tuning, gate, x, scale, floor, frozen=s.scale > 0)
        if adaptive:
            found, by_median = self._tell(todo, x, scale, floor, high)
            kind = np.where(plain, kind, found)
            white, structured = todo & (kind == Kind.WHITE), todo & (kind == Kind.STRUCTURED)
            loss, factor = np.where(white, _TUKEY, loss), np.where(white, LOSSES["tukey"], factor)
            scale[white] = (given if s.scale > 0 else by_median)[white]
            self._iterate(white, _TUKEY, LOSSES["tukey"], gate, x, scale, floor, frozen=True)
            gate = np.where(structured, self._middle(mass), gate)
            scale[structured] = by_median[structured]
            self._iterate(structured, first, tuning, gate, x, scale, floor, frozen=s.scale > 0)
        return self._result(ok, x, gate, scale, loss, factor, kind, verdicts)

    def _start(self, gate: FloatArray) -> tuple[FloatArray, BoolArray]:
        x, ok = _solve(*self._moments(gate, self.y))
        return np.where(ok, x, 0.0), ok

    def _moments(self, w: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        a, b, c = self.q.T
        table = np.stack([a * a, a * b, b * b, a * c, b * c, c * c])
        return table @ w, self.q.T @ (w * y)

    def _albedo(self, x: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(((self.r_inverse @ x) ** 2).sum(axis=0)))

    def _lit(self, x: FloatArray, gate: FloatArray) -> FloatArray:
        return np.asarray(gate * (self.q @ x > self.s.dark * self._albedo(x)))

    def _by_quantile(self, x: FloatArray, gate: FloatArray, share: float, steps: int) -> FloatArray:
        size, lit = np.abs(self.y - self.q @ x), self._lit(x, gate)
        top = np.where(lit > 0, size, 0.0).max(axis=0)
        return _quantile(size, lit, top, share * lit.sum(axis=0), steps)

    def _iterate(
        self,
        todo: BoolArray,
        loss: int,
        tuning: float,
        gate: FloatArray,
        x: FloatArray,
        scale: FloatArray,
        floor: FloatArray,
        *,
        frozen: bool,
    ) -> None:
        """Run rounds at some pixels, in place; each stops on its own."""
        active = np.flatnonzero(todo)
        self.broken[active] = False
        held = gate
        for k in range(MORE * self.s.rounds):
            if len(active) == 0:
                return
            if k == self.s.rounds:
                # What is lit, or the scale, goes back and forth. With both held each round lowers the loss.
                held, frozen = self._lit(x, gate), True
            part = self._some(active)
            r, lit = part.y - part.q @ x[:, active], held[:, active]
            lit = lit if k >= self.s.rounds else part._lit(x[:, active], lit)
            w = weight(loss, r / (tuning * scale[active])) * lit
            new, ok = _solve(*part._moments(w, part.y))
            self.broken[active[~ok]] = True
            active, new, r, w = active[ok], new[:, ok], r[:, ok], w[:, ok]
            if not frozen:
                square = (w * r * r).sum(axis=0) / np.maximum(w.sum(axis=0), 1e-30)
                scale[active] = np.maximum(np.sqrt(square / CONSISTENCY[loss]), floor[active])
            step = ((new - x[:, active]) ** 2).sum(axis=0)
            x[:, active] = new
            done = step <= self.s.tolerance**2 * (new * new).sum(axis=0)
            active = active[~done]
        self.broken[active] = True

    def _some(self, pixels: IntArray) -> "_Pixels":
        part = object.__new__(_Pixels)
        part.__dict__.update(self.__dict__)
        part.y, part.g = self.y[:, pixels], self.g[:, pixels]
        return part

    def _tell(
        self, todo: BoolArray, x: FloatArray, scale: FloatArray, floor: FloatArray, high: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Return what the residuals are like and their scale by the median; x is put where noise alone would be."""
        by_median = np.maximum(self._by_quantile(x, self.g, 0.5, 12) * MAD, floor)
        doubtful = todo & (by_median > self.s.small * high)
        calm, wide = x.copy(), by_median * self._few(x)
        broken = self.broken.copy()
        self._iterate(doubtful, _TUKEY, LOSSES["tukey"], self.g, calm, wide, floor, frozen=True)
        self.broken = broken  # a trial that fails shows itself by its residuals
        calm_median = np.maximum(self._by_quantile(calm, self.g, 0.5, 12) * MAD, floor) * self._few(calm)
        uneven = doubtful & self._structured(calm, calm_median)
        by_quartile = self._by_quantile(x, self.g, 0.25, 12) * QUARTILE
        spread_out = by_quartile > self.s.piled * by_median
        noisy = doubtful & ~uneven
        x[:, noisy], by_median[noisy] = calm[:, noisy], calm_median[noisy]
        return np.where(uneven, np.where(spread_out, Kind.STRUCTURED, Kind.PILED_UP), Kind.WHITE), by_median

    def _few(self, x: FloatArray) -> FloatArray:
        """Return by how much residuals of a fit are smaller than the errors, for the freedom that the fit took."""
        count = np.count_nonzero(self._lit(x, self.g), axis=0)
        return np.asarray(np.sqrt(count / np.maximum(count - 3.0, 1.0)))

    def _structured(self, x: FloatArray, scale: FloatArray) -> BoolArray:
        """Return where neighbouring lights have residuals alike."""
        r = self.y - self.q @ x
        kept = ((np.abs(r) < 4 * scale) & (self._lit(x, self.g) > 0)).astype(np.float64)
        count = kept.sum(axis=0)
        r = (r - (r * kept).sum(axis=0) / np.maximum(count, 1)) * kept
        one, other, times = self.neighbours
        products, pairs = times @ (r[one] * r[other]), times @ (kept[one] * kept[other])
        variance = (r * r).sum(axis=0) / np.maximum(count, 1)
        moran = products / np.maximum(pairs, 1) / (variance + 1e-30)
        return np.asarray(moran > self.s.structure * np.sqrt(96.0 / np.maximum(count, 1)))

    def _middle(self, mass: FloatArray) -> FloatArray:
        width = np.minimum(1.0, np.maximum(self.s.width, self.s.keep / np.maximum(self.usable, 1)))
        start = np.minimum(np.maximum(0.0, self.s.middle - width / 2), 1.0 - width)
        low = _quantile(self.y, self.g, np.ones_like(mass), start * mass, 12)
        high = _quantile(self.y, self.g, np.ones_like(mass), (start + width) * mass, 12)
        return np.asarray(self.g * ((self.y >= low - 5e-4) & (self.y <= high)))

    def _result(
        self,
        ok: BoolArray,
        x: FloatArray,
        gate: FloatArray,
        scale: FloatArray,
        loss: IntArray,
        factor: FloatArray,
        kind: IntArray,
        verdicts: bool,
    ) -> RobustFit:
        """Polish, and tell how sure it is."""
        r, lit = self.y - self.q @ x, self._lit(x, gate)
        t = r / (factor * scale)
        w, slope = np.zeros_like(r), np.zeros_like(r)
        for number in range(len(CONSISTENCY)):
            these = loss == number
            w[:, these] = weight(number, t[:, these]) * lit[:, these]
            slope[:, these] = weight_slope(number, t[:, these])
        polished, fine = _solve(*self._moments(w, self.y))
        x = np.where(fine, polished, x)
        looked, used = np.count_nonzero(lit, axis=0), np.count_nonzero((lit > 0) & (w >= 0.25 * lit), axis=0)
        with np.errstate(all="ignore"):
            mean = (slope * lit).sum(axis=0) / lit.sum(axis=0)
            spread = (slope * slope * lit).sum(axis=0) / lit.sum(axis=0) - mean * mean
            correction = 1 + 3.0 / looked * spread / (mean * mean)
            variance = correction**2 * ((w * r) ** 2).sum(axis=0) / (looked - 3) / (mean * mean)
            rough = (loss == 0) | ~(mean > 0)
            variance = np.where(rough, np.pi / 2 * scale**2, variance)
            variance = np.maximum(variance, self._doubt(x, lit, scale)) * self.brightest**2
        fine &= ~self.broken
        found = np.where(ok & fine, kind, np.where(ok & (kind == Kind.PLAIN), Kind.PLAIN, Kind.UNSOLVED))
        ok &= fine & (kind != Kind.PLAIN)
        judged: Array = np.zeros((0, 0), np.uint8)
        if verdicts:
            judged = self._judge(ok, x, gate, w, scale)
        return RobustFit(
            x=np.where(ok, x * self.brightest, np.nan).T,
            matrix=np.where(ok, self._moments(lit, self.y)[0], 0.0).T,
            variance=np.where(ok & (looked > 3), variance, np.nan),
            scale=np.where(ok, scale * self.brightest, np.nan),
            used=np.where(ok, used, 0),
            looked_at=np.where(ok, looked, 0),
            usable=self.usable,
            kind=found,
            verdicts=judged,
        )

    def _doubt(self, x: FloatArray, lit: FloatArray, scale: FloatArray) -> FloatArray:
        """Return the least variance where few observations agree no better than a choice among noise would.

        The probability that k of n observations of Gaussian noise lie within 3 `scale` of a fit to some three of them
        is at most the number of such choices times that of each of the others.
        """
        from scipy.special import gammaln

        n = np.count_nonzero(lit, axis=0).astype(np.float64)
        straight, fine = _solve(*self._moments(lit, self.y))
        calm = np.where(fine, straight, x)
        wide = self._by_quantile(calm, lit, 0.5, 8) * MAD * np.sqrt(n / np.maximum(n - 3, 1))
        agree = ((np.abs(self.y - self.q @ x) < 3 * scale) & (lit > 0)).sum(axis=0)
        k = np.clip(agree, 3, np.maximum(n, 3))
        share = np.minimum(1.0, 2.4 * scale / np.maximum(wide, 1e-30))
        choices = np.log(np.maximum(n - 3, 1)) + gammaln(n + 1) - gammaln(n - k + 1) - gammaln(4) - gammaln(k - 2)
        chance = choices + (k - 3) * np.log(share)
        unsure = (n < FEW) & (chance > LOG_CHANCE)
        lost = LOSS_OF_FEW / np.maximum(n, 1) * (1 - np.minimum(1, scale / np.maximum(wide, 1e-30)))
        return np.where(unsure, (1 + lost) * wide**2, 0.0)

    def _judge(self, ok: BoolArray, x: FloatArray, gate: FloatArray, w: FloatArray, scale: FloatArray) -> Array:
        p = self.q @ x
        dark = self.s.dark * self._albedo(x)
        r = self.y - p
        choices = (
            (self.g == 0, Verdict.UNUSABLE),
            (~ok & (self.g > 0), Verdict.USED),
            ((p <= dark) | (self.y <= dark), Verdict.SHADOW),
            (w >= 0.25 * self.g, Verdict.USED),
            (r > 3 * scale, Verdict.HIGHLIGHT),
            (r < -3 * scale, Verdict.DARK_OUTLIER),
            (gate == 0, Verdict.NOT_NEEDED),
        )
        return np.select([c for c, _ in choices], [np.uint8(v) for _, v in choices], np.uint8(Verdict.USED))


def _quantile(a: FloatArray, g: FloatArray, top: FloatArray, want: FloatArray, steps: int) -> FloatArray:
    """Return the values below which `want` of the weights lie, by bisection on 0 … top."""
    low, high = np.zeros_like(top), np.array(top)
    for _ in range(steps):
        middle = 0.5 * (low + high)
        below = (g * (a < middle)).sum(axis=0) < want
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return high


def _solve(a: FloatArray, b: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Solve 3 × 3 systems by Cholesky; False where one is singular, and x is NaN there."""
    tiny = 1e-7 * (a[0] + a[2] + a[5])
    with np.errstate(all="ignore"):
        l00 = np.sqrt(np.where(a[0] > tiny, a[0], np.nan))
        l10, l20 = a[1] / l00, a[3] / l00
        d = a[2] - l10 * l10
        l11 = np.sqrt(np.where(d > tiny, d, np.nan))
        l21 = (a[4] - l20 * l10) / l11
        d = a[5] - l20 * l20 - l21 * l21
        l22 = np.sqrt(np.where(d > tiny, d, np.nan))
        z0 = b[0] / l00
        z1 = (b[1] - l10 * z0) / l11
        z2 = (b[2] - l20 * z0 - l21 * z1) / l22
        x2 = z2 / l22
        x1 = (z1 - l21 * x2) / l11
        x0 = (z0 - l10 * x1 - l20 * x2) / l00
    x = np.stack([x0, x1, x2])
    return x, np.isfinite(x).all(axis=0)
