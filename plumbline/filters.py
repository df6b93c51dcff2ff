r"""Zero-phase low-pass and derivatives of what it leaves.

A Butterworth filter of order n run forth and back has :math:`|H|^2 = 1/(1 + (f/f_1)^{2n})` as its gain, so the corner
:math:`f_1` of the single pass must lie above the wanted -3 dB corner :math:`f_c` of the double pass:
:math:`f_1 = f_c\,(\sqrt 2 - 1)^{-1/(2n)}` (for n = 2: 1.246 :math:`f_c`). The bilinear transform bends frequencies, so the factor
is applied to :math:`\tan(\pi f/f_s)`, where it is exact.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from plumbline.errors import Refused

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ORDER = 2  # of one pass
DECAY = 0.01  # [1] a disturbance has died out where the filter's envelope has fallen to this share


def single_pass_corner(cutoff: float, rate: float) -> float:
    """Corner of one pass [Hz] such that two passes have their -3 dB corner at `cutoff` [Hz] (see module)."""
    factor = (np.sqrt(2.0) - 1.0) ** (-1.0 / (2 * ORDER))
    return float(np.arctan(np.tan(np.pi * cutoff / rate) * factor) * rate / np.pi)


def reach(cutoff: float) -> float:
    """Time [s] after which an end or a gap no longer shows: the slowest pole decays to `DECAY`."""
    damping = 2.0 * np.pi * cutoff * (np.sqrt(2.0) - 1.0) ** (-1.0 / (2 * ORDER)) / np.sqrt(2.0)
    return float(np.log(1.0 / DECAY) / damping)


def runs(good: Mask) -> list[tuple[int, int]]:
    """Stretches of True as half-open index pairs."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def known(values: Array) -> Mask:
    """Rows of (n, d) without a NaN, shape (n,); also (n, s, d) -> (n, s)."""
    return np.asarray(np.isfinite(values).all(axis=-1))


def low_pass(signal: Array, time: Array, cutoff: float) -> Array:
    """Second-order Butterworth, forth and back, -3 dB at `cutoff` [Hz] after both passes; NaN stays NaN.

    signal: (n,) or (n, d), any unit.  time: [s], shape (n,), even.  Each run between NaNs is filtered for itself; a run of
    three samples or fewer stays NaN.  Raises Refused ("no_rate") where the clock is too slow for the cut-off.
    """
    columns = np.asarray(signal, dtype=float).reshape(len(signal), -1)
    out = np.full(columns.shape, np.nan)
    if len(time) > 3:
        rate = 1.0 / float(np.median(np.diff(time)))
        if single_pass_corner(cutoff, rate) >= 0.45 * rate or cutoff >= 0.4 * rate:
            raise Refused("no_rate", f"cut-off {cutoff:g} Hz at {rate:g} frames/s", "lower signals.cutoff in config.yaml")
        sos = butter(ORDER, single_pass_corner(cutoff, rate), fs=rate, output="sos")
        pad = int(np.ceil(3.0 * reach(cutoff) * rate))  # the odd extension then starts from a settled filter
        for a, b in runs(known(columns)):
            if b - a > 3:
                out[a:b] = sosfiltfilt(sos, columns[a:b], axis=0, padlen=min(pad, b - a - 1))
    return out.reshape(np.shape(signal))


def derivatives(signal: Array, time: Array) -> tuple[Array, Array]:
    """First and second derivative by central differences (five points inside a run, three or fewer at its ends).

    signal: (n, d).  Returns two arrays (n, d) in units per s and per s2; NaN where the signal is.
    """
    first, second = np.full(signal.shape, np.nan), np.full(signal.shape, np.nan)
    for a, b in runs(known(signal)):
        if b - a >= 5:
            first[a:b], second[a:b] = _differences(signal[a:b], time[a:b])
    return first, second


def _differences(x: Array, time: Array) -> tuple[Array, Array]:
    h = (time[-1] - time[0]) / (len(time) - 1)
    first = np.gradient(x, h, axis=0, edge_order=2)
    first[2:-2] = (x[:-4] - 8.0 * x[1:-3] + 8.0 * x[3:-1] - x[4:]) / (12.0 * h)
    second = np.gradient(first, h, axis=0, edge_order=2)
    second[2:-2] = (-x[:-4] + 16.0 * x[1:-3] - 30.0 * x[2:-2] + 16.0 * x[3:-1] - x[4:]) / (12.0 * h**2)
    return first, second


def edges(good: Mask, rate: float, cutoff: float) -> Mask:
    """Frames within the filter's reach of an end or a gap of `good` (n,); gaps themselves included."""
    span = int(np.ceil(reach(cutoff) * rate))
    out = np.ones(len(good), dtype=bool)
    for a, b in runs(good):
        out[a + span : max(b - span, a + span)] = False
    return out
