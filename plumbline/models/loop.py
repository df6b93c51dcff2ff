r"""The closed loop of Murai 2013 with whatever a real controller adds to the law, simulated beside the measured motion.

.. math:: p = \mathrm{out}\Bigl(\mathrm{clip}\bigl(\mathrm{asked}(d + k_1\,\mathrm{place}(x_s - d) + k_2 \dot x_s
    + \mathrm{added})\bigr)\Bigr),
    \qquad (x_s, \dot x_s) = \mathrm{seen}(\text{past})

Each effect changes one of these stages by a `Term`. Only the deviation from the measured motion is integrated,

.. math:: \delta\ddot x = \omega^2 (\delta x - \delta p), \qquad
    \delta p = p(x + \delta x, \dot x + \delta\dot x, \text{past}) - p_{measured}

from rest at the start of each locus, so that nothing the plant lacks counts against the controller. Where law and measured ZMP are both
at the same limit :math:`\delta p = 0`: half a millimetre of a limit would grow as e^(wt).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import Batch

Array = NDArray[np.float64]
Sizes = Sequence[Array]

STAGES = ("seen", "reference", "place", "added", "asked", "out")
FAR, FAST = 0.5, 2.0  # [m], [m/s] a simulated CoM that strays further or faster is held there


@dataclass(frozen=True)
class Term:
    """One way in which an effect changes the law; with all sizes 0 it changes nothing.

    stage, function: one of STAGES, and what happens there, every array (k, m) of k laws and m loci, sizes one each per parameter:

    - seen: (now, sizes) -> x, x' that the law sees [m, m/s];  reference: (now, sizes) -> shift of d [m];
    - place: (x - d, now, sizes) -> what k1 multiplies [m];  added: (now, sizes) -> added to the ZMP asked for [m];
    - asked: (p, now, sizes) -> p, before the limits;  out: the same, after the limits.

    starts: sizes from which a fit begins; the best is kept.  steps: changes of the sizes for the derivatives.
    beside: ids of effects of which at least one must be in the law for this term to leave any trace; empty for none.
    framewise: judged against the measured ZMP frame by frame, not in the simulated loop: for laws whose zones only noise leads through.
    odds: log odds with which this effect is named before another that fits as well.
    """

    stage: str
    function: Callable[..., Any]
    starts: tuple[tuple[float, ...], ...]
    steps: tuple[float, ...]
    beside: tuple[str, ...] = ()
    framewise: bool = False
    odds: float = 0.0

    def __post_init__(self) -> None:
        """Raises ValueError for a stage that the loop does not have."""
        if self.stage not in STAGES:
            raise ValueError(f"stage '{self.stage}': one of {', '.join(STAGES)} is wanted")


class Now:
    """What a term may look at in one frame.

    x, v: CoM and its velocity now [m, m/s].  seen: what the law sees of them.  far: seen x - d [m].  time: since the record began [s],
    (m,).  step: [s].  limits: left, right [m].  area: integral of the measured x from the record's start to the locus' [m s], (m,);
    swept: of x since then.
    kept: what this term returned one frame before (at the start: the measured ZMP for asked and out, else 0).
    before: what a term of asked and out was given one frame before (at the start: the measured ZMP).
    """

    def __init__(self, scene: "Scene", k: int) -> None:
        batch = scene.batch
        self.step, self.begun, self.lead = 1 / batch.rate, scene.begun, batch.lead
        self.limits, self.area = scene.limits, scene.area
        self.past_x, self.past_v = (np.empty((len(batch.x), k, batch.x.shape[1])) for _ in "xv")
        for past, measured in ((self.past_x, batch.x), (self.past_v, batch.v)):
            past[: self.lead + 1] = measured[: self.lead + 1, None]
        self.row, self._swept = self.lead, (self.lead, np.zeros(self.past_x.shape[1:]))
        self.x, self.v = self.past_x[self.lead], self.past_v[self.lead]
        self.seen, self.far, self.kept, self.before = (self.x, self.v), self.x, self.x, self.x
        self.which = np.arange(k)[:, None], np.arange(batch.x.shape[1])[None]

    def at(self, row: int, x: Array, v: Array) -> None:
        """Go to a frame where the CoM is at x with v."""
        self.row, self.past_x[row], self.past_v[row] = row, x, v
        self.x, self.v = self.past_x[row], self.past_v[row]

    @property
    def time(self) -> Array:
        """Time since the record began [s], (m,)."""
        return np.asarray(self.begun + (self.row - self.lead) * self.step)

    @property
    def swept(self) -> Array:
        """Integral of x since the locus began [m s], (k, m)."""
        row, area = self._swept
        for i in range(row, self.row):
            area = area + self.step / 2 * (self.past_x[i] + self.past_x[i + 1])
        self._swept = max(row, self.row), area
        return area

    def past(self, age: Array) -> tuple[Array, Array]:
        """x [m] and x' [m/s] as they were `age` ago [s], (k, m) or (k, 1); straight between frames."""
        at = np.maximum(self.row - age / self.step, 0.0)
        low = np.minimum(at.astype(np.int64), self.row - 1)
        part = at - low
        where = (self.which[0][:, 0],) if low.shape[1] == 1 else self.which
        one = low[:, 0] if low.shape[1] == 1 else low
        x, v = (a[(one, *where)] * (1 - part) + a[(one + 1, *where)] * part for a in (self.past_x, self.past_v))
        return x, v


@dataclass(frozen=True)
class Scene:
    """What the laws are simulated against.

    batch: loci.  regime: (n, m), -1 left limit, 0 inside, +1 right.  omega: of the plant [rad/s].  limits: left, right [m].
    begun: time from the record's start to each locus' first frame [s], (m,).  area: integral of the CoM over that time [m s], (m,).
    """

    batch: Batch
    regime: NDArray[np.int8]
    omega: float
    limits: tuple[float, float]
    begun: Array
    area: Array

    def take(self, loci: NDArray[np.bool_]) -> "Scene":
        """Some of the loci.  loci: mask."""
        return Scene(self.batch.take(loci), self.regime[:, loci], self.omega, self.limits, self.begun[loci], self.area[loci])


def simulate(points: Array, scene: Scene, terms: Sequence[tuple[Term, int]] = (), *, closed: bool = True) -> Array:
    """Simulated minus measured CoM and ZMP [m] for k laws, shape (2, n, k, m), 0 outside loci.

    points: (3 + number of sizes, k, m or 1): d [m], k1 [1], k2 [s], then the sizes of each term.  terms: term and how many sizes it has.
    closed: False to leave the CoM as measured: law against measured ZMP frame by frame.
    The plant is integrated exactly for a ZMP that is linear between frames.
    """
    batch, t = scene.batch, scene.omega / scene.batch.rate
    (n, m), k = batch.x.shape, points.shape[1]
    now, law = Now(scene, k), _Law(points, scene, terms, k, closed)
    out = np.zeros((2, n, k, m))
    c, s, w = np.cosh(t), np.sinh(t), scene.omega
    rise = np.array([s / t - 1, w * (c - 1) / t])  # what a rise of dp over a step takes off dx and dx'
    step = np.array([[c, s / w, 1 - c, -rise[0]], [w * s, c, -w * s, -rise[1]]])
    state = np.zeros((4, k * m))  # dx, dx', dp, rise of dp
    dx, dv, dp, up = state.reshape(4, k, m)
    law.warm(now)
    for row in range(batch.lead, int(batch.end.max())):
        now.at(row, batch.x[row] + dx, batch.v[row] + dv)
        new = law.zmp(now)
        out[0, row], out[1, row] = dx, new
        if not closed:
            continue
        if row > batch.lead:  # the step that led here took the ZMP's rise to go on; now it is known
            grown = new - dp
            miss = grown - up
            dx -= rise[0] * miss
            dv -= rise[1] * miss
            out[0, row], up[:] = dx, grown
        dp[:] = new
        state[:2] = step @ state
        np.clip(state[:2], [[-FAR], [-FAST]], [[FAR], [FAST]], out=state[:2])
    return out * batch.inside[:, None]


class _Law:
    """The law with its terms, asked frame by frame."""

    def __init__(self, points: Array, scene: Scene, terms: Sequence[tuple[Term, int]], k: int, closed: bool) -> None:
        self.closed = closed
        self.d, self.k1, self.k2 = points[:3]
        self.scene = scene
        self.at: dict[str, list[int]] = {stage: [] for stage in STAGES}
        self.terms = [term for term, _ in terms]
        self.sizes, first = [], 3
        for i, (term, count) in enumerate(terms):
            self.at[term.stage].append(i)
            self.sizes.append(tuple(points[first : first + count]))
            first += count
        shape = (k, scene.batch.x.shape[1])
        start = np.broadcast_to(scene.batch.p[scene.batch.lead], shape)
        self.kept = [start if t.stage in ("asked", "out") else np.zeros(shape) for t in self.terms]
        self.before = list(self.kept)
        self.fresh = True

    def warm(self, now: Now) -> None:
        """Let what acts before the limits live through the measured motion ahead of each locus: at a limit its state cannot be seen."""
        lead, batch = self.scene.batch.lead, self.scene.batch
        if self.at["asked"]:
            for row in range(1, lead):
                now.at(row, *(np.broadcast_to(a[row], now.x.shape) for a in (batch.x, batch.v)))
                self.zmp(now)
            for i in self.at["asked"]:
                self.kept[i] = np.where(self.scene.regime[lead] == 0, batch.p[lead], self.kept[i])

    def zmp(self, now: Now) -> Array:
        """Law minus measured ZMP [m], (k, m)."""
        left, right = self.scene.limits
        measured, regime = self.scene.batch.p[now.row], self.scene.regime[now.row]
        now.seen = now.x, now.v
        for i in self.at["seen"]:
            now.seen = self._call(i, now)
        d = self.d
        for i in self.at["reference"]:
            d = d + self._call(i, now)
        far = now.far = now.seen[0] - d
        for i in self.at["place"]:
            far = self._call(i, now, far)
        asked = d + self.k1 * far + self.k2 * now.seen[1]
        for i in self.at["added"]:
            asked = asked + self._call(i, now)
        for i in self.at["asked"]:
            asked = self._call(i, now, asked)
        p = np.minimum(np.maximum(asked, left), right)
        for i in self.at["out"]:
            given, p = p, self._call(i, now, p)
            self.kept[i] = np.where(p == given, measured, p)
        dp = p - measured
        if regime.any():
            dp[((asked >= right) & (regime > 0)) | ((asked <= left) & (regime < 0))] = 0.0
        for i in self.at["out"] if self.closed else ():
            self.kept[i] = measured + dp
        return np.asarray(dp)

    def _call(self, i: int, now: Now, *given: Array) -> Any:
        now.kept, now.before = self.kept[i], self.before[i]
        out = self.terms[i].function(*given, now, self.sizes[i])
        if self.terms[i].stage in ("asked", "out"):
            self.before[i] = given[0]
        if self.terms[i].stage != "seen":
            self.kept[i] = out
        return out
