r"""Recursive least squares along loci, forwards and back ("returning", Murai, Kaneta, Sugihara 2013), for all loci at once.

.. math:: \theta_k = \arg\min_\theta \sum_{i=1}^{k} \lambda^{k-i} (y_i - \phi_i^T \theta)^2
    + \lambda^k (\theta - \theta_0)^T P_0^{-1} (\theta - \theta_0)

The classical loop follows this minimum by updates of a gain and of P. Here it is solved for at each frame from

.. math:: S_k = \sum \lambda^{k-i} \phi_i \phi_i^T + \lambda^k P_0^{-1}, \qquad
    b_k = \sum \lambda^{k-i} \phi_i y_i + \lambda^k P_0^{-1} \theta_0, \qquad S_k \theta_k = b_k

so no error is handed from frame to frame: it stays near the unit roundoff times cond(S_k), however long the locus.

Arrays run in time along axis 0 and over loci along axis 1. A block of frames and loci is worked on at once:

- Frames lie in `RUN` rows: row j holds frames j, j + RUN, j + 2 RUN, ... Adding row j - 1 to row j sums within runs of RUN
  frames, one long operation for all runs; what the runs before add up to follows (prefix sums on two levels).
- The sum of earlier blocks is carried with its rounding error (Knuth's two-sum): the error does not grow with the frames.
- Forgetting scales frames by lambda^(-t/2), t from the start of the block. S and b then share lambda^-t; only S is scaled back.
"""

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbline.errors import PlumblineError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Arrays = Sequence[Array]
Real = ArrayLike
Frames = ArrayLike | None

SINGULAR = 1e-13
"""No estimate where this share or less of a regressor's sum of squares is left after the regressors before it are taken out."""

RUN = 16  # frames summed in one run
CELLS = 1 << 16  # frames times loci in a block
WIDTH = 256  # most loci in a block
GROWTH = 1e100  # most that lambda^-t may reach within a block

_KEPT = threading.local()


class Trace(NamedTuple):
    """Estimates along the loci.

    theta: (c, n, m), NaN where not determined.  information: upper triangle of S_k row by row (11, 12, 13, 22, 23, 33 for c = 3),
    shape (c (c + 1)/2, n, m).
    """

    theta: Array
    information: Array


def forward(y: Array, phi: Arrays, *, forgetting: float = 1.0, p0: Real = np.inf, theta0: Real = 0.0, length: Frames = None) -> Trace:
    r"""Regularised least squares of y = phi theta over frames 0..k, for each k (equations above).

    y: (n, m), n frames of m loci.  phi: c regressors, each (n, m).  forgetting: lambda in (0, 1].  p0: diagonal of P0 [unit of
    1/phi2], one number or (c,); infinite: no prior.  theta0: [unit of y/phi], one number, (c,) or (c, m).  length: frames of each
    locus, (m,); what lies behind is not looked at, and there the trace keeps its last value.
    theta is NaN as long as S_k cannot be inverted: for fewer than c frames without a prior, and where a regressor is collinear
    with those before it (:data:`SINGULAR`). Raises ValueError where shapes or ranges do not fit, PlumblineError where a locus
    holds a sample that is not finite.
    """
    return _run(_task(y, phi, forgetting, p0, theta0, length, back=False))


def backward(y: Array, phi: Arrays, *, forgetting: float = 1.0, p0: Real = np.inf, theta0: Real = 0.0, length: Frames = None) -> Trace:
    """The same over frames k..N - 1, from the end N of each locus; arguments and errors of :func:`forward`.

    Behind the end of a locus theta is NaN and the information 0.
    """
    return _run(_task(y, phi, forgetting, p0, theta0, length, back=True))


def returning(
    y: Array, phi: Arrays, *, forgetting: float = 1.0, p0: Real = np.inf, theta0: Real = 0.0, reset: Real = np.inf, length: Frames = None
) -> tuple[Trace, Trace]:
    """Forward, then backward from the end of each locus, started at theta_F[N] with P0 reset to `reset` (Murai 2013).

    reset: as p0.  With a finite one the backward estimates begin at theta_F[N] (at theta0 where that is NaN) and leave it as the
    frames outweigh it; with the default they are NaN for the last c - 1 frames. For lambda = 1 and p0 infinite both passes see the
    same sums in the end: theta_B[0] = theta_F[N] for any reset.  Other arguments and errors: :func:`forward`.
    """
    task, c = _task(y, phi, forgetting, p0, theta0, length, back=False), len(phi)
    # one piece of memory: two would be given back to the system after each call, and fetched page by page in the next
    both = np.empty((2, len(_pairs(c)) + c, *task.data[0].shape))
    there = _run(task, both[0])
    end = there.theta[:, -1]
    begin = np.where(np.isnan(end), task.theta0, end)
    return there, _run(_task(y, phi, forgetting, reset, begin, length, back=True), both[1])


def deviation(trace: Trace, s: Real) -> Array:
    r"""Standard deviations of theta, :math:`s \sqrt{\mathrm{diag}\, S_k^{-1}}`, shape (c, n, m); NaN where S_k is singular.

    s: standard deviation of y [unit of y], any shape that broadcasts to (n, m).  Exact for white noise, lambda = 1 and no prior; a
    prior counts as observed, and with forgetting this is the P of the classical loop.
    """
    c, n, m = trace.theta.shape
    normal = dict(zip(_pairs(c), trace.information, strict=True))
    work, flag, out = np.empty((2 + c * (c - 1) // 2, n, m)), np.empty((n, m), dtype=bool), np.empty((c, n, m))
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(c):  # one entry of column i of the inverse is wanted
            unit = np.zeros((c, n, m))
            unit[i] = 1.0
            _solve(dict(normal), list(unit), work, flag)
            out[i] = np.sqrt(np.where(np.isfinite(unit[i]), unit[i], np.nan)) * s
    return out


class _Task(NamedTuple):
    """Arrays in the order of the pass.

    data: regressors and y, c + 1 times (n, m).  forgetting: lambda.  weight: diagonal of P0^-1, (c,).  theta0: (c, m).
    first, last: frames first <= k < last of each locus count, (m,).  back: time is turned around.
    """

    data: tuple[Array, ...]
    forgetting: float
    weight: Array
    theta0: Array
    first: Ints
    last: Ints
    back: bool


def _task(y: Array, phi: Arrays, forgetting: float, p0: Real, theta0: Real, length: Frames, *, back: bool) -> _Task:
    """Check the arguments of :func:`forward`; turn time around for a backward pass."""
    data = tuple(np.asarray(f, dtype=np.float64) for f in (*phi, y))
    shapes, c = [f.shape for f in data], len(data) - 1
    if c < 1 or len(shapes[0]) != 2 or 0 in shapes[0] or len(set(shapes)) > 1:
        raise ValueError(f"y and one or more regressors must share one shape (frames, loci), not {shapes[-1]} and {shapes[:-1]}")
    n, m = shapes[0]
    variance = np.broadcast_to(np.asarray(p0, dtype=np.float64), (c,))
    if not (0.0 < forgetting <= 1.0 and np.all(variance > 0.0)):
        raise ValueError(f"the forgetting factor must lie in (0, 1] and p0 be positive, not {forgetting} and {variance}")
    ends = np.broadcast_to(np.asarray(n if length is None else length, dtype=np.int64), (m,))
    if ends.min() < 1 or ends.max() > n:
        raise ValueError(f"the length of a locus must lie in 1..{n}, not {ends.min()}..{ends.max()}")
    begin = np.asarray(theta0, dtype=np.float64)
    rest = (forgetting, 1.0 / variance, np.broadcast_to(begin[:, None] if begin.ndim == 1 else begin, (c, m)))
    if back:
        return _Task(tuple(f[::-1] for f in data), *rest, n - ends, np.full(m, n), back)
    return _Task(data, *rest, np.zeros(m, dtype=np.int64), ends, back)


def _pairs(c: int) -> list[tuple[int, int]]:
    """Rows and columns of the upper triangle, row by row."""
    return [(i, j) for i in range(c) for j in range(i, c)]


def _run(task: _Task, out: Array | None = None) -> Trace:
    """The trace of one pass; out: where S (upper triangle) and theta go, (c (c + 1)/2 + c, n, m)."""
    (n, m), c = task.data[0].shape, len(task.weight)
    out = np.empty((len(_pairs(c)) + c, n, m)) if out is None else out
    width = -(-m // -(-m // WIDTH))  # the fewest blocks, of like size
    most = CELLS // (RUN * width)
    if task.forgetting < 1.0:
        most = min(most, int(-np.log(GROWTH) / np.log(task.forgetting)) // RUN)
    runs = -(-n // (RUN * -(-n // (RUN * max(most, 1)))))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # ufuncs copy operands whose rows are not in one piece through buffers of this many numbers, which takes longer than the
        # work; rows longer than the buffer are used where they lie. errstate restores the size
        np.setbufsize(16)
        for start in range(0, m, width):
            loci = slice(start, start + width)
            data = tuple(f[:, loci] for f in task.data)
            part = task._replace(data=data, theta0=task.theta0[:, loci], first=task.first[loci], last=task.last[loci])
            if len(bad := _columns(part, _Desk(c, runs, data[0].shape[1], task.forgetting), out[:, :, loci])):
                raise PlumblineError(f"locus {start + bad[0]} (from 0) holds samples that are not finite: end it before them")
    shortest = int(task.last.min())
    if shortest < n:  # behind its end a locus keeps its last value
        end = out[:, task.last - 1, np.arange(m)]
        np.copyto(out[:, shortest:], end[:, None], where=np.arange(shortest, n)[:, None] >= task.last)
    out = out[:, ::-1] if task.back else out
    return Trace(out[-c:], out[:-c])


class _Desk:
    """Scratch of one block, carved from memory that a thread keeps: the page faults of fresh memory take longer than the sums.

    x: regressors and y, (c + 1, RUN, runs, loci).  s: products, then sums, (sums, RUN, runs, loci).  work: planes for the solution.
    frame: number of a frame within the block, (RUN, runs, 1).  root, power: lambda^(-t/2), lambda^t.  Planes are (RUN, runs * loci).
    """

    def __init__(self, c: int, runs: int, loci: int, forgetting: float) -> None:
        plane, sums = RUN * runs * loci, len(_pairs(c)) + c
        planes = np.cumsum([c + 1, sums, 2 + c * (c - 1) // 2, 2])
        if len(getattr(_KEPT, "memory", ())) < planes[-1] * plane:
            _KEPT.memory = np.empty(planes[-1] * plane)
        x, s, work, scale = np.split(_KEPT.memory[: planes[-1] * plane], planes[:-1] * plane)
        self.runs = runs
        self.x = x.reshape(c + 1, RUN, runs, loci)
        self.s = s.reshape(sums, RUN, runs, loci)
        self.work = work.reshape(-1, RUN, runs * loci)
        self.flag = np.empty((RUN, runs * loci), dtype=bool)
        self.frame = np.arange(RUN)[:, None, None] + RUN * np.arange(runs)[:, None]
        self.root, self.power = scale.reshape(2, RUN, runs * loci)
        if forgetting < 1.0:
            for exponent, kept in zip((-0.5, 1.0), scale.reshape(2, RUN, runs, loci), strict=True):
                kept[:] = forgetting ** (exponent * self.frame)


def _columns(task: _Task, desk: _Desk, out: Array) -> Ints:
    """All frames of some loci, block by block; returns the loci with samples that are not finite."""
    n, c, frames, p = out.shape[1], len(task.weight), RUN * desk.runs, len(_pairs(len(task.weight)))
    flat = desk.s.reshape(p + c, RUN, -1)
    carry = np.zeros((2, *out.shape[::2]))
    for start in range(0, n, frames):
        stop = min(start + frames, n)
        _load(task, desk, start, stop)
        _products(task, desk, start)
        _accumulate(desk.s, carry)
        carry *= task.forgetting**frames
        _solve({pair: flat[k] for k, pair in enumerate(_pairs(c))}, list(flat[p:]), desk.work, desk.flag)
        if task.forgetting < 1.0:
            flat[:p] *= desk.power
        full, rest = divmod(stop - start, RUN)
        np.copyto(out[:, start : stop - rest].reshape(p + c, full, RUN, out.shape[2]), desk.s[:, :, :full].swapaxes(1, 2))
        np.copyto(out[:, stop - rest : stop], desk.s[:, :rest, full % desk.runs])
    return np.flatnonzero(~np.isfinite(carry).all(axis=(0, 1)))


def _load(task: _Task, desk: _Desk, start: int, stop: int) -> None:
    """Bring regressors and y of a block to the desk; zeros behind the last frame and where a locus has none."""
    full, rest = divmod(stop - start, RUN)
    if full < desk.runs:
        desk.x[:, :, full:] = 0.0
    for plane, source in zip(desk.x, task.data, strict=True):
        np.copyto(plane[:, :full], source[start : stop - rest].reshape(full, RUN, plane.shape[2]).swapaxes(0, 1))
        np.copyto(plane[:rest, full % desk.runs], source[stop - rest : stop])
    if task.first.max() > start or task.last.min() < stop:
        frame = start + desk.frame
        np.copyto(desk.x, 0.0, where=(frame < task.first) | (frame >= task.last))


def _products(task: _Task, desk: _Desk, start: int) -> None:
    """Each frame's share of S and b, with the prior in the share of the first frame."""
    c, pairs = len(task.weight), _pairs(len(task.weight))
    x, s = desk.x.reshape(c + 1, RUN, -1), desk.s.reshape(len(pairs) + c, RUN, -1)
    if task.forgetting < 1.0:
        np.multiply(x, desk.root, out=x)
    for k, (i, j) in enumerate(pairs + [(i, c) for i in range(c)]):
        np.multiply(x[i], x[j], out=s[k])
    since = task.first - start
    loci = np.flatnonzero((since >= 0) & (since < RUN * desk.runs))
    if task.weight.any() and len(loci):
        run, row = np.divmod(since[loci], RUN)
        for i, weight in enumerate(task.weight):
            share = weight * task.forgetting ** (1.0 - since[loci])
            desk.s[pairs.index((i, i)), row, run, loci] += share
            desk.s[len(pairs) + i, row, run, loci] += share * task.theta0[i, loci]


def _accumulate(s: Array, carry: Array) -> None:
    """Prefix sums over the frames of a block, in place; carry: sum of the blocks before and its rounding error, (2, sums, loci)."""
    rows = s.reshape(len(s), RUN, -1).swapaxes(0, 1)
    for j in range(1, RUN):
        np.add(rows[j], rows[j - 1], out=rows[j])
    before = np.concatenate([carry[1][:, None], s[:, -1]], axis=1)
    step = 1
    while step < before.shape[1]:  # the reach of each sum doubles: rounding grows with the logarithm of the runs
        before[:, step:] += before[:, :-step]
        step *= 2
    total, high = before[:, -1].copy(), carry[0].copy()
    before += high[:, None]
    np.add(s, before[:, None, :-1], out=s)
    carry[0] = high + total
    part = carry[0] - high
    carry[1] = (high - (carry[0] - part)) + (total - part)


def _solve(normal: dict[tuple[int, int], Array], right: list[Array], work: Array, flag: NDArray[np.bool_]) -> None:
    """Solve S theta = b by S = L D L^T in every cell, theta in place of b, arrays of S untouched; work: 2 + c (c - 1)/2 planes."""
    c = len(right)
    factor, term, *free = work
    diagonal = [normal[i, i] for i in range(c)]
    for i in range(c):
        if i:
            np.multiply(diagonal[i], SINGULAR, out=term)
            np.less_equal(normal[i, i], term, out=flag)
            np.copyto(normal[i, i], np.nan, where=flag)
        for j in range(i + 1, c):
            np.divide(normal[i, j], normal[i, i], out=factor)
            for k in range(j, c):
                taken = free.pop() if i == 0 else term
                np.multiply(factor, normal[i, k], out=taken)
                normal[j, k] = np.subtract(normal[j, k], taken, out=taken if i == 0 else normal[j, k])
            np.multiply(factor, right[i], out=factor)
            np.subtract(right[j], factor, out=right[j])
    for i in reversed(range(c)):
        for j in range(i + 1, c):
            np.multiply(normal[i, j], right[j], out=term)
            np.subtract(right[i], term, out=right[i])
        np.divide(right[i], normal[i, i], out=right[i])
