r"""Output error of the closed loop with effects: laws that compete for the ZMP a person gives from push end on.

The simulated ZMP owes nothing to the feedback noise, the measured one carries it through the loop. What is left,
:math:`\delta p`, is averaged over `BLOCK`, so that sensor noise and what the muscles shake do not count, and freed of its own colour,

.. math:: e_i = \Bigl(\overline{\delta p}_i - \sum_{j=1}^{2} a_j\, \overline{\delta p}_{i-j}\Bigr)/s, \qquad \min \sum e_i^2,

with a, s from the residual of the best law (generalised least squares: consistent for any fixed filter, Ljung 1999, section 8.4). Plain
output error weighs the slow rest of the noise most and can hardly tell a delay from larger gains. Blocks in which the law is near a
limit do not count: there the noise rounds the limit, and a clean law would seem late.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.models.loop import Scene, Term, simulate

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Whiten = Callable[[Array], Array]

BLOCK = 0.08  # [s]
ORDER = 2  # of the noise's own colour
MARGIN = 2.5  # sd of the feedback noise that the law must stay away from a limit
ROUNDS = 14
PATIENCE, BEHIND = 3, 1.3  # rounds after which a start that costs so much more than the best is given up
SETTLED = 1e-4  # share of the cost that a full step promises, below which the search has settled
BOUNDS = ((-0.3, 0.3), (1.01, 20.0), (0.0, 8.0))  # of d from where the person is [m], k1 [1], k2 [s]
STEPS = (1e-5, 1e-3, 1e-3)


@dataclass(frozen=True)
class Candidate:
    """A law with some effects.

    effects: ids, () for the base.  terms: term and number of its sizes.  low, high: bounds of the sizes.  starts: combinations to begin
    from, (r, number of sizes).  closed: in the simulated loop, else frame by frame.
    """

    effects: tuple[str, ...]
    terms: tuple[tuple[Term, int], ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    starts: Array
    closed: bool = True

    def simulate(self, points: Array, scene: Scene) -> Array:
        """Outputs of laws (3 + sizes, k, m or 1), see :func:`plumbline.models.loop.simulate`."""
        return simulate(points, scene, self.terms, closed=self.closed)

    @property
    def steps(self) -> Array:
        """Changes of all parameters for the derivatives."""
        return np.array([*STEPS, *[h for term, _ in self.terms for h in term.steps]])

    def bounds(self, scene: Scene) -> tuple[Array, Array]:
        """Least and largest parameters; d is counted from the middle of the measured CoM, not from the laboratory's origin."""
        middle = float(np.median(scene.batch.x[scene.batch.inside]))
        low, high = (np.array([*[b[end] for b in BOUNDS], *own]) for end, own in enumerate((self.low, self.high)))
        low[0], high[0] = low[0] + middle, high[0] + middle
        return low, high


class Fit(NamedTuple):
    """theta: d, k1, k2, sizes (q,); cost of each locus (m,), its normal matrix (m, q, q) and half gradient (m, q); settled."""

    candidate: Candidate
    theta: Array
    cost: Array
    normals: Array
    scores: Array
    settled: bool


class Colour(NamedTuple):
    """Autoregressions of order 0 to ORDER of the block means and the sd of what each leaves [m]."""

    coefficients: tuple[Array, ...]
    sd: tuple[float, ...]


@dataclass(frozen=True)
class Criterion:
    """Outputs -> e of each block, (blocks, k, m); age: (blocks, m) blocks that count since the last that does not, -1 where none."""

    colour: Colour
    age: NDArray[np.int64]
    lead: int
    width: int

    def __call__(self, outputs: Array) -> Array:
        """e of the simulated outputs (2, n, k, m)."""
        y = blocks(outputs[1], self.lead, self.width)
        out = np.zeros_like(y)
        last = len(self.colour.sd) - 1
        for order, (a, sd) in enumerate(zip(self.colour.coefficients, self.colour.sd, strict=True)):
            left = y.copy()
            for j, share in enumerate(a, start=1):
                left[j:] -= share * y[:-j]
            use = self.age == order if order < last else self.age >= order
            out += np.where(use[:, None], left / sd, 0.0)
        return out


def blocks(y: Array, lead: int, width: int) -> Array:
    """Means over `width` frames from row `lead` on; y: (n, ...)."""
    count = (len(y) - lead) // width
    return np.asarray(y[lead : lead + count * width].reshape(count, width, *y.shape[1:]).mean(1))


def joint(outputs: Array, scene: Scene) -> Whiten:
    """Criterion before the colour is known: CoM and ZMP, each in its own rms over the outputs (2, n, 1, m) of a first law."""
    scale = np.maximum(np.sqrt(np.sum(outputs**2, axis=(1, 2, 3)) / scene.batch.inside.sum()), 1e-9)
    return lambda o: np.concatenate([o[0] / scale[0], o[1] / scale[1]])


def criterion(outputs: Array, scene: Scene, until: float = np.inf) -> Criterion | None:
    """The criterion whose colour is that of a law's outputs (2, n, 1, m); None where too few blocks are left to tell it.

    until: time from each locus' start after which nothing counts [s].
    """
    dp = outputs[1][:, 0]
    inside = scene.batch.inside & (scene.regime == 0)
    sd = float(np.median(np.abs(dp[inside]))) / 0.6745 if inside.any() else 0.0
    law = scene.batch.p + dp
    free = inside & (law > scene.limits[0] + MARGIN * sd) & (law < scene.limits[1] - MARGIN * sd)
    lead, width = scene.batch.lead, max(1, round(BLOCK * scene.batch.rate))
    free &= (np.arange(len(free)) - scene.batch.lead)[:, None] < until * scene.batch.rate
    whole = blocks(free.astype(float), lead, width) > 1 - 1e-9
    age = np.full(whole.shape, -1)
    for i in range(len(age)):
        age[i] = np.where(whole[i], (age[i - 1] if i else -1) + 1, -1)
    y = blocks(dp, lead, width)
    coefficients: list[Array] = []
    sds: list[float] = []
    for order in range(ORDER + 1):
        row, locus = np.nonzero(age >= order)
        if len(row) < 10 * (order + 1):
            return None
        past = np.stack([y[row - j, locus] for j in range(1, order + 1)], axis=1) if order else np.zeros((len(row), 0))
        a = np.linalg.lstsq(past, y[row, locus], rcond=None)[0]
        left = y[row, locus] - past @ a
        coefficients.append(np.asarray(a, dtype=np.float64))
        sds.append(max(float(np.sqrt(np.mean(left**2))), 1e-6))
    return Criterion(Colour(tuple(coefficients), tuple(sds)), age, lead, width)


def fit(candidate: Candidate, bases: Array, scene: Scene, whiten: Whiten, rounds: int = ROUNDS) -> Fit:
    """Least squares of a candidate's parameters from all of its starts at once (Levenberg 1944, Marquardt 1963); the best is kept.

    bases: d, k1, k2 to begin from, (3,) or (b, 3): each start is tried with each.
    """
    bases = np.atleast_2d(bases)
    theta = np.array([[*b, *s] for b in bases for s in candidate.starts]).T
    low, high = candidate.bounds(scene)
    theta = np.clip(theta, low[:, None], high[:, None])
    now = _Slopes.at(theta, candidate, scene, whiten)
    damp, ready = np.full(theta.shape[1], 1e-3), np.zeros(theta.shape[1], bool)
    for turn in range(rounds):
        cost = now.cost.sum(1)
        if turn >= PATIENCE:
            kept = np.flatnonzero(cost < BEHIND * cost.min())
            theta, now, damp, ready = theta[:, kept], now.take(kept), damp[kept], ready[kept]
        new = theta.copy()
        for r in np.flatnonzero(~ready):
            new[:, r], promise = _step(theta[:, r], now.normals[r].sum(0), now.scores[r].sum(0), damp[r], low, high)
            ready[r] = promise < SETTLED * now.cost[r].sum() or damp[r] > 1e6
        if ready.all():
            break
        tried = _Slopes.at(new, candidate, scene, whiten)
        better = tried.cost.sum(1) < now.cost.sum(1)
        theta = np.where(better, new, theta)
        damp = np.where(better, np.maximum(damp * 0.1, 1e-7), damp * 30)
        now = now.where(better, tried)
    best = int(np.argmin(now.cost.sum(1)))
    return Fit(candidate, theta[:, best], now.cost[best], now.normals[best], now.scores[best], bool(ready[best]))


def _step(theta: Array, normal: Array, score: Array, damp: float, low: Array, high: Array) -> tuple[Array, float]:
    """The next parameters within their bounds and what a full step promises of the cost."""
    free = ~(((theta <= low) & (score > 0)) | ((theta >= high) & (score < 0)))
    kept = np.ix_(free, free)
    promise = float(score[free] @ np.linalg.lstsq(normal[kept], score[free], rcond=None)[0])
    out = theta.copy()
    out[free] -= np.linalg.solve(normal[kept] + damp * np.diag(np.diag(normal[kept]) + 1e-12), score[free])
    return np.clip(out, low, high), promise


class _Slopes(NamedTuple):
    """Cost (r, m), normal matrices (r, m, q, q) and half gradients (r, m, q) of r laws."""

    cost: Array
    normals: Array
    scores: Array

    @classmethod
    def at(cls, theta: Array, candidate: Candidate, scene: Scene, whiten: Whiten) -> "_Slopes":
        """theta: (q, r)."""
        q, runs = theta.shape
        steps = candidate.steps
        points = np.repeat(theta[:, :, None], q + 1, axis=2)
        for j in range(q):
            points[j, :, j + 1] += steps[j]
        outputs = whiten(candidate.simulate(points.reshape(q, runs * (q + 1), 1), scene))
        outputs = outputs.reshape(len(outputs), runs, q + 1, -1)
        error = outputs[:, :, 0]
        slopes = (outputs[:, :, 1:] - error[:, :, None]) / steps[:, None]
        turned = slopes.transpose(1, 3, 2, 0)  # (r, m, q, n)
        return cls((error**2).sum(0), turned @ turned.transpose(0, 1, 3, 2), (turned @ error.transpose(1, 2, 0)[..., None])[..., 0])

    def take(self, runs: NDArray[np.int64]) -> "_Slopes":
        """Some of the laws."""
        return _Slopes(*(a[runs] for a in self))

    def where(self, better: Mask, other: "_Slopes") -> "_Slopes":
        """The other's numbers where it is better."""
        return _Slopes(*(np.where(better.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(self, other, strict=True)))


def left_out(got: Fit, fold: NDArray[np.int64], scene: Scene, whiten: Whiten) -> Array:
    """Parameters of each locus' law when its fold is left out, (q, m): two damped Newton steps from the fit to all.

    fold: (m,) numbers.  A parameter that lies at its bound stays there.
    """
    names = np.unique(fold)
    low, high = got.candidate.bounds(scene)
    at_low, at_high = (got.theta <= low) | (low == high), got.theta >= high
    low, high = np.where(at_high, high, low), np.where(at_low, low, high)
    rest = [fold != f for f in names]
    theta = np.tile(got.theta[:, None], (1, len(names)))
    first = [_step(got.theta, got.normals[r].sum(0), got.scores[r].sum(0), 1e-6, low, high)[0] for r in rest]
    new = np.array(first).T
    slopes = _Slopes.at(new, got.candidate, scene, whiten)
    out = np.empty((len(theta), len(fold)))
    for i, r in enumerate(rest):
        better = slopes.cost[i, r].sum() < got.cost[r].sum()
        normal, score = (slopes.normals[i, r], slopes.scores[i, r]) if better else (got.normals[r], got.scores[r])
        best, _ = _step(new[:, i] if better else theta[:, i], normal.sum(0), score.sum(0), 1e-3 if better else 1.0, low, high)
        out[:, ~r] = best[:, None]
    return out


def judged(theta: Array, candidate: Candidate, scene: Scene, whiten: Whiten) -> tuple[Array, Array, Array]:
    """Of k laws on each locus, (q, k, m): sum of squares of dx [m2], of dp [m2], and of e [1], each (k, m)."""
    outputs = candidate.simulate(theta, scene)
    dx, dp = np.sum(outputs**2, axis=1)
    return dx, dp, np.sum(whiten(outputs) ** 2, axis=0)


def gain(base: Array, other: Array, groups: Sequence[str]) -> tuple[float, float]:
    """Log likelihood that a law gains over another on loci left out, and its t over the groups.  base, other: sums of e2, (m,)."""
    names = np.asarray(groups)
    each = np.array([(base - other)[names == g].sum() / 2 for g in np.unique(names)])
    spread = float(np.sqrt(np.sum((each - each.mean()) ** 2) * len(each) / max(len(each) - 1, 1)))
    return float(each.sum()), float(each.sum() / spread) if spread > 0 else 0.0
