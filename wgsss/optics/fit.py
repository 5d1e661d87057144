"""Fits sums of Gaussians to diffusion profiles (003 eq. 2, 004 section 3.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wgsss.errors import InputError
from wgsss.optics.gaussians import SumOfGaussians, gaussian
from wgsss.optics.profile import Profile
from wgsss.optics.samples import DISTANCES, MEASURE, levelled, raw, root_energy, scale

Array = NDArray[np.float64]

# The first guess spreads the Gaussians between the radii that hold these shares of the light. For the twelve measured
# materials no random start was found to end lower.
_START = (0.05, 0.97)


def fit_gaussians(profile: Profile, k: int = 6) -> SumOfGaussians:
    """The sum of at most `k` Gaussians nearest to `profile` in each channel, with variances (k, 3) of its own.

    Minimises the r-weighted squared error of 003 eq. 2, with weights >= 0 and the energy left free: most of what eq. 2
    does not see, the tail, is lost. Over the twelve materials of Jensen et al. 2001, in percent, at worst:

        k             1     2     3     4     5     6
        fit_error    29.1   9.84  3.69  1.52  0.68  0.32
        light lost   61    33    20    12     8.2   5.5

    To keep the light, scale the weights by profile.total / fit.total, or take `fit_shared_gaussians`. A sum of no more
    than `k` Gaussians is its own fit. Where R is infinite at r = 0, it is fitted as if it were level within the radius
    that holds a hundredth of its light. Deterministic. Raises InputError for k < 1.
    """
    _check(k)
    if isinstance(profile, SumOfGaussians) and len(profile.variances) <= k:
        variances = np.broadcast_to(profile.variances.T, profile.weights.shape[::-1]).T
        return SumOfGaussians(variances, profile.weights)
    unit = scale(profile)
    R = levelled(profile, unit)
    variances, weights = np.ones((k, 3)), np.zeros((k, 3))
    for c in np.flatnonzero(R.any(axis=0)):
        v, w = _nearest(R[:, [c]], None, k)
        variances[:, c] = np.append(v, np.full(k - len(v), v[-1]))
        weights[: len(v), c] = w[:, 0]
    used = max(1, np.count_nonzero(weights.any(axis=1)))
    return SumOfGaussians(variances[:used] * np.square(unit), weights[:used])


def fit_shared_gaussians(profile: Profile, k: int = 6) -> SumOfGaussians:
    """The sum of at most `k` Gaussians nearest to `profile`, with variances (k,) shared by the channels, for blurs.

    Minimises the r-weighted squared error of 003 eq. 2, relative to each channel's own energy and summed over the
    channels, with weights >= 0 and the total kept: sum_k w_k = profile.total in each channel. Left to itself a fit
    loses up to 8 % of a high albedo's light (18 % at k = 4) in the tail, where eq. 2 hardly looks; the constraint
    returns it through the widest Gaussians. At k = 6 the error is below 0.93 % for each measured material of Jensen
    et al. 2001. A sum of no more than `k` shared Gaussians is its own fit. Deterministic. Raises InputError for k < 1.
    """
    _check(k)
    if isinstance(profile, SumOfGaussians) and profile.variances.ndim == 1 and profile.variances.size <= k:
        return profile
    total = profile.total
    lit = np.flatnonzero(total > 0)
    if lit.size == 0:
        return SumOfGaussians(np.ones(1), np.zeros((1, 3)))
    # In steps of four decades, which leaves three of the ten at least on either side.
    unit = 10.0 ** (4.0 * np.round(np.log10(scale(profile)[lit]).mean() / 4.0))
    variances, found = _nearest(levelled(profile, np.full(3, unit))[:, lit], total[lit], k)
    weights = np.zeros((len(variances), 3))
    weights[:, lit] = found
    return SumOfGaussians(variances * np.square(unit), weights)


def fit_error(profile: Profile, fit: Profile) -> Array:
    """Relative error (3,) of a fit: the root of int r (R - S)^2 dr over int r R^2 dr; 0 for a black channel.

    In percent this is the error that 003 quotes below its eq. 2. A profile that is infinite at r = 0 counts as level
    near there, as in `fit_gaussians`.
    """
    unit = scale(profile)
    wanted = levelled(profile, unit)
    energy = root_energy(wanted)
    return root_energy(raw(fit, unit) - wanted) / np.where(energy > 0, energy, 1.0)


def _check(k: int) -> None:
    if k < 1:
        raise InputError(f"a fit needs at least one Gaussian, not {k}")


def _nearest(R: Array, total: Array | None, k: int) -> tuple[Array, Array]:
    """The variances (n <= k,), ascending, and weights (n, c) of the sum nearest to the samples `R` (n, c)."""
    energy = root_energy(R)
    problem = _Separable(np.sqrt(MEASURE) * R / energy, None if total is None else total / energy)
    inside = np.cumsum(MEASURE * R, axis=0)
    low, high = (DISTANCES[(inside < share * inside[-1]).sum(axis=0)] for share in _START)
    log_variance, weights = problem.minimise(2.0 * np.linspace(np.log(low.min()), np.log(high.max()), k))
    kept = [i for i in np.argsort(log_variance) if weights[i].any()]
    return np.exp(log_variance[kept]), weights[kept] * energy


class _Separable:
    """Least squares over log variances, with the best weights for them inside (variable projection).

    `wanted`: (n, c) samples per channel; `total`: (c,) what the weights of a channel sum to, or None: they are free.
    """

    def __init__(self, wanted: Array, total: Array | None) -> None:
        self.wanted = wanted
        self.total = [None] * wanted.shape[1] if total is None else total.tolist()

    def minimise(self, log_variance: Array) -> tuple[Array, Array]:
        """Levenberg-Marquardt from `log_variance` (k,); gives the log variances found and their weights (k, c)."""
        damping = 1e-3
        residual, jacobian, weights = self.linearise(log_variance)
        for _ in range(100):
            normal = jacobian.T @ jacobian
            normal[np.diag_indices_from(normal)] *= 1.0 + damping
            normal[np.diag_indices_from(normal)] += 1e-12
            trial = log_variance - np.clip(np.linalg.solve(normal, jacobian.T @ residual), -1.0, 1.0)
            found = self.linearise(trial)
            gain = residual @ residual - found[0] @ found[0]
            if gain > 0:
                log_variance, (residual, jacobian, weights) = trial, found
                damping = max(damping / 5.0, 1e-9)
                if gain < 1e-6 * (residual @ residual):
                    break
            elif damping > 1e6:
                break
            else:
                damping *= 5.0
        return log_variance, weights

    def linearise(self, log_variance: Array) -> tuple[Array, Array, Array]:
        """Residual (n*c,), its derivative by the log variances (n*c, k) after Kaufman, and the weights (k, c)."""
        variance = np.exp(log_variance)
        basis = np.sqrt(MEASURE) * gaussian(variance, DISTANCES[:, None])
        slope = basis * (np.square(DISTANCES)[:, None] / (2.0 * variance) - 1.0)
        weights = np.stack(
            [_weights(basis, y, total) for y, total in zip(self.wanted.T, self.total, strict=True)], axis=1
        )
        jacobian = []
        for w in weights.T:
            free = basis[:, w > 0]
            if self.total[0] is not None:
                free = free[:, 1:] - free[:, :1]
            q, _ = np.linalg.qr(free)  # what a change of weights can undo
            change = slope * w
            jacobian.append(change - q @ (q.T @ change))
        return (basis @ weights - self.wanted).T.ravel(), np.concatenate(jacobian), weights


def _weights(basis: Array, wanted: Array, total: float | None) -> Array:
    """The w (k,) >= 0, with sum `total` if there is one, that minimises |basis w - wanted|^2: a primal active set."""
    k = basis.shape[1]
    gram, target = basis.T @ basis, basis.T @ wanted
    kkt = np.block([[gram, np.ones((k, 1))], [np.ones((1, k)), np.zeros((1, 1))]])
    right = np.append(target, total or 0.0)
    sum_row = [k] if total is not None else []
    w = np.full(k, (total or 1.0) / k)
    free = np.ones(k, dtype=bool)
    for _ in range(10 * k):
        rows = np.append(np.flatnonzero(free), sum_row).astype(int)
        best, *_ = np.linalg.lstsq(kkt[np.ix_(rows, rows)], right[rows], rcond=None)
        count = np.count_nonzero(free)
        step = np.zeros(k)
        step[free] = best[:count] - w[free]
        blocked = np.where(w + step < 0, w / np.where(step < 0, -step, 1.0), 1.0)
        if blocked.min() < 1.0:
            w = w + blocked.min() * step
            free[blocked.argmin()] = False
            w[~free] = 0.0
            continue
        w = w + step
        pull = np.where(free, 0.0, gram @ w - target + best[count:].sum())  # < 0: the error falls if this weight grows
        if pull.min() >= -1e-12:
            break
        free[pull.argmin()] = True
    return w if total is None else w * (total / w.sum())
