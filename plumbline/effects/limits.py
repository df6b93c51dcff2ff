"""The ZMP nears its limits by a soft knee instead of a sharp one."""

from plumbline.effects._effect import Effect, Parameter

EFFECT = Effect(
    title="Soft limits of the ZMP",
    ledger="control",
    equation=r"\mathrm{clip} \to \text{a smooth box with a knee of width } s",
    source="this file; no paper. Feedback noise ahead of sharp limits rounds them in the same way, so that returns from pushes do not tell",
    needs=("pressure_edge",),
    parameters=(Parameter("knee", "m", 0.0, 0.05, matters=0.004),),
    confounded=("lag", "sensory"),
    separated="slow leans to both limits; pressure under the edge of each foot",
)
