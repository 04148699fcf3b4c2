"""How a fit can end."""

RUNNING, CONVERGED, PERFECT, STALLED, OUT_OF_STEPS, NOT_FINITE, INTERRUPTED = range(7)

MESSAGES = {
    RUNNING: "still running",
    CONVERGED: "converged: further steps change the cost by less than the tolerance",
    PERFECT: "converged: the data are met to rounding",
    STALLED: "stalled: no step lowers the cost; the model may not be smooth here",
    OUT_OF_STEPS: "not converged: out of steps; raise max_steps",
    NOT_FINITE: "failed: the model is not finite at the start; check the start values",
    INTERRUPTED: "interrupted: these are the best values so far",
}
