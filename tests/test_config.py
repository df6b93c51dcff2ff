"""A closed config with honest messages."""

import pytest

from plumbline.config import with_defaults
from plumbline.errors import PlumblineError


def test_absent_empty_and_braces_are_alike() -> None:
    """No config, an empty one and {} give the same defaults."""
    assert with_defaults(None) == with_defaults({}) == with_defaults({"signals": None})
    assert with_defaults({})["signals"]["cutoff"] == 2.0


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"signal": {}}, "did you mean 'signals'"),
        ({"signals": {"cut_off": 3}}, "'signals.cut_off': did you mean 'cutoff'"),
        ({"signals": {"cutoff": "6"}}, "signals.cutoff"),
        ({"evaluation": {"half_width": 0}}, "evaluation.half_width"),
        ({"axes": {"x": "right", "y": "+X", "z": "+Y"}}, "axes"),
        ({"completely_else": 1}, "known here"),
    ],
)
def test_mistakes_are_named_with_their_place(config: dict[str, object], said: str) -> None:
    """A misspelt key is met with the nearest one; a wrong value with its key."""
    with pytest.raises(PlumblineError, match=said):
        with_defaults(config)
