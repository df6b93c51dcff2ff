"""Was a file low-passed before it came to us? Then its upper band holds no noise, and the noise floor cannot be told from it."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from plumbline.filters import runs

Array = NDArray[np.float64]

MOST = 8192  # samples of a signal that are looked at for its noise
EMPTY_RATIO = 0.06  # [1] power density of the upper band over the middle band below which the file was low-passed
EMPTY_MARKER = 2e-6  # [m] noise below what any camera reaches: only rounding is left
EMPTY_FORCE = 2e-3  # [N]


def most_are_empty(channels: Iterable[Array], rate: float, noise_floor: float) -> bool:
    """Verdict of most of the channels that can be judged, each (n,) at `rate` [Hz]; see :func:`band_is_empty`."""
    votes = [v for v in (band_is_empty(c, rate, noise_floor) for c in channels) if v is not None]
    return bool(votes) and sum(votes) > len(votes) / 2


def band_is_empty(signal: Array, rate: float, noise_floor: float) -> bool | None:
    """Whether a signal was low-passed before: its upper band holds no noise.

    signal: (n,).  The power density in 0.70-0.95 of the Nyquist frequency is compared with 0.30-0.50 of it (medians, so that a
    spike or a hum line decides nothing); white noise as small as `noise_floor` [unit of the signal] is rounding. None where the
    longest run without NaN is below 64 samples.
    """
    spans = runs(np.isfinite(signal))
    a, b = max(spans, key=lambda s: s[1] - s[0], default=(0, 0))
    if b - a < 64:
        return None
    share, power = _density(np.asarray(signal[a : min(b, a + MOST)]), rate)
    upper = float(np.median(power[(share > 0.70) & (share < 0.95)]))
    middle = float(np.median(power[(share > 0.30) & (share < 0.50)]))
    white = np.sqrt(upper / np.log(2.0) * rate / 2.0)  # a periodogram's median is ln 2 of its mean
    return bool(white < noise_floor or upper < EMPTY_RATIO * middle)


def _density(x: Array, rate: float) -> tuple[Array, Array]:
    """Frequency as a share of the Nyquist frequency and one-sided power density [unit2/Hz] of one Hann-windowed piece."""
    n = len(x)
    t = np.linspace(-1.0, 1.0, n)
    level = x - x.mean()
    flat = level - t * (t @ level) / (t @ t)
    window = np.hanning(n + 1)[:n]
    power = 2.0 * np.abs(np.fft.rfft(flat * window)) ** 2 / (rate * (window @ window))
    return np.linspace(0.0, 1.0, len(power)), power
