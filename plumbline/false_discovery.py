"""How many of the effects that are named may be there by chance."""

from collections.abc import Mapping


def false_discovery_rate(p: Mapping[str, float]) -> dict[str, float]:
    """q of each p: Benjamini and Hochberg 1995."""
    order = sorted(p, key=lambda k: -p[k])
    out, least = {}, 1.0
    for rank, name in zip(range(len(order), 0, -1), order, strict=True):
        least = min(least, p[name] * len(order) / rank)
        out[name] = least
    return out
