"""The law acts on the state as it was some time ago."""

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def seen(now: Now, sizes: Sizes) -> tuple[Array, Array]:
    """x [m] and x' [m/s] a delay ago."""
    return now.past(sizes[0])


EFFECT = Effect(
    title="Neural delay of the feedback",
    ledger="control",
    equation=r"p = \mathrm{clip}\bigl(d + k_1 (x(t - D) - d) + k_2 \dot x(t - D)\bigr)",
    source="a delay of 0.1 to 0.2 s is the usual assumption; Masani 2008",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("delay", "s", 0.0, 0.25, matters=0.025),),
    confounded=("lag",),
    separated="a sudden push: the latency of the first reaction",
    law=(Term("seen", seen, ((0.03,), (0.08,), (0.14,)), (2e-3,), odds=10.0),),  # nobody reacts at once
)
