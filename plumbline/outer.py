r"""A contact that no plate measures (seat, box, a person): found by itself in time, then its load and its line of action.

What the plates miss is :math:`F_{ex} = m\ddot x - F_x` and :math:`F_{ez} = m(\ddot z + g) - F_z`. Almost every model error leaves
something there; a contact comes and goes, pulls to one side, and does not follow from where the body is and how fast it moves.
Its moment tells the line:

.. math:: (x - p) - h F_x/m = \bigl(h - h_e/g\bigr) F_{ex}/m + (x_e - p) F_{ez}/(m g)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit
from scipy.stats import ttest_1samp

from plumbline.evidence import Weak, split
from plumbline.filters import runs
from plumbline.found import Candidate, Finding, Found, Interval
from plumbline.physics import G
from plumbline.search import BASE, CLUSTERS, design

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CONTACT = "push"  # id of the effect
LOUD = 5.0  # [1] times noise and usual faults, from which on something acts
ALIKE = 3  # trials from which on most of them tell what is usual
LOAD = 0.02  # [1] of body weight, the same for what the plates do not carry
LATERAL = 0.002  # [1] of body weight, the same for a force to the side
REST = 0.35  # [1] share of windows in which nothing must act
ACTS = 0.03  # [1] and in which something must
ALWAYS = 0.9  # [1] of a trial
SIDE = 0.97  # [1] of its square that must have one sign
EVEN = 0.02  # [1] by which a force to the side may vary while it acts, beside noise; what carries weight can be nothing else
EVEN_NOISE = 1.5  # [1] times the noise, the same
FULL = 0.2  # [1] of its usual size, from which on a load that the record cuts short is one: bodies bounce
GAP = 1.5  # [1] of the distance of windows, from which on there is one between them
LOWER = 0.9  # [1] of the error without it, which it must reach
LAST = 2**31 - 1  # a frame after the last of any record
LONG = 0.3  # [s] that it must act at a time


@dataclass(frozen=True)
class Contact:
    """What acts beside the plates on one subject, one axis.

    loud: of each trial, windows in which it acts or that it touches.  pull, load: Fex, Fez of each trial's windows [N].
    lateral, vertical: whether it pulls to the side, carries weight.
    """

    loud: tuple[Mask, ...]
    pull: tuple[Array, ...]
    load: tuple[Array, ...]
    lateral: bool
    vertical: bool


class Line(NamedTuple):
    """Line of action: force carried [N], place x [m] where it carries weight, force to the side [N] and its height [m]; NaN where not."""

    force: float
    x: float
    lateral: float
    height: float


def find(windows: Sequence[Weak], faults: float) -> Contact | None:
    """The contact of one subject and axis; None where none is seen, or where shear or vertical are not recorded.

    faults: rms of what usual model errors leave of the acceleration [m/s2].
    """
    if not all(np.isfinite(w.force).all() for w in windows):
        return None
    side = _centred([w.acceleration - w.force for w in windows])
    upright = all(np.isfinite(w.vertical).all() for w in windows)
    down = _centred([w.vertical if upright else np.zeros(len(w.time)) for w in windows])
    known = [w.floor("kinematic", 0.1) for w in windows]
    noise = float(np.sqrt(np.mean(known))) if np.isfinite(known).all() else float(np.median(np.abs(np.concatenate(side))))
    seen = LOUD * float(np.hypot(noise, faults))
    lateral = _acts(windows, side, max(seen, LATERAL * G), float(noise), seen)
    floor = float(np.sqrt(np.mean([np.nan_to_num(w.floor("vertical", 0.1)) for w in windows])))
    vertical = _acts(windows, down, max(LOUD * floor, LOAD * G), np.inf, LOAD * G)
    if lateral is None and vertical is None:
        return None
    loud = tuple(_widened(w, m) for w, m in zip(windows, _either(lateral, vertical, windows), strict=True))
    mass = [w.mass for w in windows]
    pull = tuple(m * s for m, s in zip(mass, side, strict=True))
    load = tuple(m * s for m, s in zip(mass, down, strict=True))
    return Contact(loud, pull, load, lateral is not None, vertical is not None)


def masses(windows: Sequence[Weak]) -> dict[str, float]:
    """Body mass in each trial [kg], as its windows tell it by the vertical force; of all trials where a contact carries some."""
    each = _masses(windows)
    usual = _usual(each)
    return {k: float(np.median(m)) if _steady(m) else usual for k, m in each.items()}


class Scale(NamedTuple):
    """Plates that carry more or less in some trials than most of the time.

    trials: share in each [1].  s: their mean with its 95 % interval from trial to trial, NaN of a single one; None where signs differ.
    """

    trials: Mapping[str, float]
    s: Interval | None


def scale(windows: Sequence[Weak], possible: float = np.inf) -> Scale | None:
    """The scale of the plates in the trials where it matters; None where it matters in none, or where too few trials tell what is usual.

    One who weighs more in one trial than in the next has put something on, or stands on plates that read too much.
    possible: largest share [1]; what takes more is no scale.
    """
    each = _masses(windows)
    usual = _usual(each)
    shares = {k: float(np.median(m)) / usual - 1 for k, m in each.items() if _steady(m)}
    odd = {k: v for k, v in shares.items() if LOAD / 2 < abs(v) <= possible}
    if not odd or len(each) < ALIKE:
        return None
    values = np.array(list(odd.values()))
    half = float(stdtrit(len(odd) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(odd))) if len(odd) > 1 else float("nan")
    mean = float(values.mean())
    return Scale(odd, (mean, mean - half, mean + half) if abs(np.sign(values).sum()) == len(values) else None)


def _masses(windows: Sequence[Weak]) -> dict[str, Array]:
    """Body mass that each window tells by the vertical force [kg], by trial; only those with the vertical recorded."""
    return {w.trial: w.mass * (1 - w.vertical / G) for w in windows if np.isfinite(w.vertical).all() and len(w.vertical)}


def _usual(masses: Mapping[str, Array]) -> float:
    return float(np.median(np.concatenate(list(masses.values())))) if masses else float("nan")


def _steady(mass: Array) -> bool:
    """Whether nothing else carries some of the person for a while."""
    return bool(np.mean(np.abs(mass / np.median(mass) - 1) > LOAD) <= ACTS)


def _centred(values: Sequence[Array]) -> list[Array]:
    """Less what it is most of the time: nothing acts in more than half of the windows, though it may in one trial."""
    middle = np.median(np.concatenate(list(values)))
    return [np.asarray(v - middle) for v in values]


def _either(a: list[Mask] | None, b: list[Mask] | None, windows: Sequence[Weak]) -> list[Mask]:
    nothing = [np.zeros(len(w.time), bool) for w in windows]
    return [x | y for x, y in zip(a or nothing, b or nothing, strict=True)]


def _acts(windows: Sequence[Weak], residual: Sequence[Array], least: float, noise: float, cut: float) -> list[Mask] | None:
    """Windows in which a residual is a contact's, of each trial; None where it is not one.

    noise: by which it may vary while it acts.  cut: from which on it acts where the record cuts it short.
    """
    masks = [_runs(np.abs(r) > least, w.time) for r, w in zip(residual, windows, strict=True)]
    masks = [m & (m.mean() < ALWAYS) for m in masks]  # all through a trial: a fault of the record would look the same
    loud, every = np.concatenate(masks), np.concatenate(list(residual))
    share = loud.mean()
    if not ACTS < share < 1 - REST:
        return None
    square = every[loud] ** 2
    if max(square[every[loud] > 0].sum(), square[every[loud] < 0].sum()) < SIDE * square.sum():
        return None
    size = float(np.sqrt(square.mean()))
    if _uneven(windows, residual, masks) > max(EVEN, EVEN_NOISE * noise / size):
        return None
    side = np.sign(every[loud].sum())  # seen elsewhere, it may also be seen where the record ends or begins
    ends = [_runs(r * side > cut, w.time, full=r * side > FULL * size) for r, w in zip(residual, windows, strict=True)]
    return [m | c for m, c in zip(masks, ends, strict=True)]


def _runs(loud: Mask, time: Array, *, full: Mask | None = None) -> Mask:
    """Without runs shorter than LONG, but for those that reach `full` and that a beginning, an end or a gap may have made short."""
    out = loud.copy()
    gap = _gaps(time)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], loud.view(np.int8), [0]])))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        cut = full is not None and full[a:b].any() and (gap[a] or gap[b])
        if time[b - 1] - time[a] < LONG and not cut:
            out[a:b] = False
    return out


def _uneven(windows: Sequence[Weak], residual: Sequence[Array], masks: Sequence[Mask]) -> float:
    """Scatter of a contact around its mean, in parts of it, away from its beginning and end: the median over the times that it acts.

    Where the body is and how it moves tells little: someone who is pushed stands elsewhere for as long. But a spring, a wall or a magnet
    pulls more or less as the body moves, and a contact hardly does. A time that is short, or that the record cuts short, is all beginning:
    it tells nothing.
    """
    each = []
    for w, r, loud in zip(windows, residual, masks, strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], loud.view(np.int8), [0]])))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            time = w.time[a:b][_half(r[a:b])]
            if time[-1] - time[0] < LONG:
                continue
            reach = min(w.bump.half_width, (time[-1] - time[0]) / 3)
            core = r[a:b][(w.time[a:b] >= time[0] + reach) & (w.time[a:b] <= time[-1] - reach)]
            if len(core) > 1:
                each.append(np.sqrt(np.mean((core - core.mean()) ** 2) / np.mean(core**2)))
    return float(np.median(each)) if each else 1.0


def _widened(w: Weak, loud: Mask) -> Mask:
    """With the windows whose test function reaches into a contact."""
    out = loud.copy()
    for time in w.time[loud]:
        out |= np.abs(w.time - time) < w.bump.half_width
    return out


def quiet(windows: Sequence[Weak], contact: Contact) -> list[Weak]:
    """Windows that the contact does not touch; trials without any are left out."""
    return [only(w, ~loud) for w, loud in zip(windows, contact.loud, strict=True) if (~loud).sum() >= 3]


def only(w: Weak, chosen: Mask) -> Weak:
    """Some windows of a trial."""
    arrays = ("frame", "time", "cluster", "com", "velocity", "zmp", "acceleration", "force", "vertical")
    terms = {name: {part: values[chosen] for part, values in parts.items()} for name, parts in w.terms.items()}
    return replace(w, **{k: getattr(w, k)[chosen] for k in arrays}, terms=terms, w2=None if w.w2 is None else w.w2[chosen])


def line(windows: Sequence[Weak], contact: Contact, rest: Sequence[Array], h: float, without: int = -1) -> Line:
    """Line of action of a contact.

    rest: what the model without it leaves of the moment equation, of each trial [m].  h: lever per acceleration [s2].  without: piece.
    """
    a, y, loud = _columns(windows, contact, rest)
    loud = loud & (pieces(windows, contact) != without)
    if not loud.any():
        return Line(*[float("nan")] * 4)
    theta, *_ = np.linalg.lstsq(a[loud], y[loud], rcond=None)
    pull, load = (np.concatenate(v)[loud] for v in (contact.pull, contact.load))
    names = iter(theta)
    height = G * (h - next(names)) if contact.lateral else float("nan")
    x = float(next(names)) if contact.vertical else float("nan")
    force = _plateau(load) if contact.vertical else float("nan")
    return Line(force, x, _plateau(pull) if contact.lateral else float("nan"), float(height))


def _plateau(values: Array) -> float:
    """Mean of a force while it acts in full: where it is more than half of the most."""
    return float(np.mean(values[np.abs(values) > np.quantile(np.abs(values), 0.95) / 2]))


def explained(windows: Sequence[Weak], contact: Contact, rest: Sequence[Array]) -> list[Array]:
    """What is left of `rest` once the contact is in, its line told from the other pieces; of each trial [m]."""
    a, y, loud = _columns(windows, contact, rest)
    piece = pieces(windows, contact)
    out = np.concatenate(list(rest))
    for k in np.unique(piece):
        others, mine = loud & (piece != k), loud & (piece == k)
        if others.sum() > a.shape[1] and mine.any():
            theta, *_ = np.linalg.lstsq(a[others], y[others], rcond=None)
            out[mine] = y[mine] - a[mine] @ theta
    return split(out, windows)


def pieces(windows: Sequence[Weak], contact: Contact) -> NDArray[np.int64]:
    """What is left out together, for each window: trials; pieces of them where the contact acts in fewer than three."""
    trial = np.repeat(np.arange(len(windows)), [len(w.time) for w in windows])
    if sum(m.any() for m in contact.loud) >= 3:
        return trial
    cluster = np.concatenate([w.cluster for w in windows])
    return np.asarray(np.unique(np.column_stack([trial, cluster]), axis=0, return_inverse=True)[1].ravel())


def _columns(windows: Sequence[Weak], contact: Contact, rest: Sequence[Array]) -> tuple[Array, Array, Mask]:
    """Columns and left side of the moment equation with a contact, and where it acts."""
    mass = np.concatenate([np.full(len(w.time), w.mass) for w in windows])
    p = np.concatenate([w.zmp for w in windows])
    pull, load = (np.concatenate(v) / mass for v in (contact.pull, contact.load))
    y = np.concatenate(list(rest)) + (p * load / G if contact.vertical else 0.0)
    columns = [pull] * contact.lateral + [load / G] * contact.vertical
    return np.column_stack(columns), y, np.concatenate(contact.loud)


# -- what is said -----------------------------------------------------------------------------------------------------


def named(
    finding: Finding, windows: Sequence[Sequence[Weak]], contacts: Sequence[Contact | None], w2: Sequence[float], h: Sequence[float]
) -> Finding | None:  # fmt: skip
    """A finding about the windows without a contact, with the contact; errors are of all windows.  None where its moment is not there.

    windows: of each subject.  w2 [1/s2], h [s2]: of each subject.
    """
    before, after, seen = [], [], []
    for ws, contact, theta, k, lever in zip(windows, contacts, finding.theta, w2, h, strict=True):
        rest = [_rest(w, "whole", theta, k, lever) for w in ws]
        told = explained(ws, contact, rest) if contact else rest
        before += rest
        after += told
        if contact:
            moment = [_rest(w, "moment", theta, k, lever) for w in ws]
            seen.append((*_line(ws, contact, moment, lever), _gains(ws, contact, rest, told)))
    error = [float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for e in (before, after)]
    if not error[1] < LOWER * error[0]:
        return None
    gains = np.concatenate([g for _, _, g in seen])
    # fewer can tell no chance; that it is there was seen in time, far above the noise
    p = float(ttest_1samp(gains, 0.0, alternative="greater").pvalue) if len(gains) >= CLUSTERS else float("nan")
    parameters = _parameters(np.array([line for line, _, _ in seen]), np.array([spread for _, spread, _ in seen]))
    push = Found(CONTACT, (CONTACT,), parameters, error[0], error[1], p, p)
    tried = [*(c for c in finding.candidates if c.effect != CONTACT), Candidate(CONTACT, "found", error[1], p=p)]
    others = [replace(f, before=float(np.sqrt(max(error[1] ** 2 + f.before**2 - f.after**2, 0.0))), after=error[1]) for f in finding.found]
    acts = [spans(ws, contact) if contact else {} for ws, contact in zip(windows, contacts, strict=True)]
    return replace(finding, found=[push, *others], candidates=sorted(tried, key=lambda c: c.effect), final=error[1], acts=acts)


def spans(windows: Sequence[Weak], contact: Contact) -> dict[str, list[tuple[int, int]]]:
    """Trial -> first and last frame of each time that a contact acts.

    Beside a gap of the windows (a push) it is taken to act to its middle, beside an end of the record to that: it is not seen there.
    """
    out: dict[str, list[tuple[int, int]]] = {}
    forces = contact.load if contact.vertical else contact.pull
    for w, loud, force in zip(windows, contact.loud, forces, strict=True):
        acts = np.zeros(len(loud), bool)
        for a, b in runs(loud):
            acts[a:b] = _half(force[a:b])
        gap = _gaps(w.time)
        for a, b in runs(acts):
            first = w.frame[a] if not gap[a] else (w.frame[a - 1] + w.frame[a]) // 2 + 1 if a else 0
            last = w.frame[b - 1] if not gap[b] else (w.frame[b - 1] + w.frame[b]) // 2 if b < len(acts) else LAST
            out.setdefault(w.trial, []).append((int(first), int(last)))
    return out


def _gaps(time: Array) -> Mask:
    """Whether windows are missing before each, and after the last, (n + 1,)."""
    steps = np.diff(time)
    return np.concatenate([[True], steps > GAP * np.median(steps), [True]]) if len(time) > 1 else np.ones(len(time) + 1, bool)


def _half(force: Array) -> Mask:
    """Where a force is more than half of what it is in full: a test function whose middle is where it begins sees half of it."""
    size = np.abs(force)
    return np.asarray(size > np.quantile(size, 0.9) / 2)


def _rest(w: Weak, equation: str, theta: Mapping[str, Array], w2: float, h: float) -> Array:
    """What a model leaves of an equation in every window."""
    names = [n for n in theta if not n.startswith("=")]
    columns, left = design(w, equation, names, w2, h)
    return np.asarray(left - columns @ np.concatenate([theta[n] for n in (*BASE, *names)]))


def _line(windows: Sequence[Weak], contact: Contact, rest: Sequence[Array], h: float) -> tuple[Line, Array]:
    """Line of action and its standard errors, a jackknife over the pieces in which it acts."""
    at = np.unique(pieces(windows, contact)[np.concatenate(contact.loud)])
    each = [line(windows, contact, rest, h, without=int(k)) for k in at]
    return line(windows, contact, rest, h), np.sqrt((len(each) - 1) * np.var(each, axis=0))


def _gains(windows: Sequence[Weak], contact: Contact, rest: Sequence[Array], told: Sequence[Array]) -> Array:
    """Log of the squared error without over that with the contact, in each piece in which it acts."""
    at, acts = pieces(windows, contact), np.concatenate(contact.loud)
    a, b = np.concatenate(list(rest)), np.concatenate(list(told))
    return np.array([np.log(np.mean(a[m] ** 2) / np.mean(b[m] ** 2)) for m in ((at == k) & acts for k in np.unique(at[acts]))])


def _parameters(lines: Array, spread: Array) -> dict[str, Interval]:
    """Line in the middle of the subjects, with its 95 % interval: from their spread, of one or two from their own errors."""
    error = lines.std(axis=0, ddof=1) if len(lines) > 2 else np.sqrt(np.mean(np.square(spread), axis=0))
    half = 2 * error / np.sqrt(len(lines))
    middle = np.median(lines, axis=0)
    return {k: (float(v), float(v - r), float(v + r)) for k, v, r in zip(Line._fields, middle, half, strict=True) if np.isfinite(v)}
