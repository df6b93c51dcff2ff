"""Ankles and hips act by their own laws; the net ZMP is their mean, weighted by the load of each leg."""

from plumbline.effects._effect import Effect, Parameter

EFFECT = Effect(
    title="Load and unload by the hips",
    ledger="control",
    equation=r"p = (F_L p_L + F_R p_R)/(F_L + F_R)",
    source="Winter's two mechanisms; no source for a split of k1",
    needs=("ankle_moment_left", "ankle_moment_right"),
    parameters=(Parameter("share", "1", 0.0, 1.0),),
    confounded=(),
    separated="moments of both ankles beside the load of each leg",
)
