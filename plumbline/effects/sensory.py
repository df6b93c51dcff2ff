"""The law sees x and x' with noise of the senses."""

from plumbline.effects._effect import Effect, Parameter

EFFECT = Effect(
    title="Noise of the senses",
    ledger="control",
    equation=r"k_1 (x + n - d) + k_2 (\dot x + \dot n)",
    source="graviceptive noise is ten times the proprioceptive: van der Kooij and Peterka 2011",
    needs=("sensed_x",),
    parameters=(Parameter("noise", "m", 0.0, 0.02),),
    confounded=("intermittent",),
    separated="a record of what the senses see; noise of the muscles looks the same in the ZMP",
)
