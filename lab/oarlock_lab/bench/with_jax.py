"""Times the unscented filter in JAX: the whole recording is one compiled `lax.scan`, in double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from oarlock_lab.bench.problem import WARM, BenchProblem, Floats
from oarlock_lab.bench.sigma_filter import SigmaFilter


def make(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over all samples after the warm-up: means, (steps, n). The first call compiles."""
    import jax
    from jax import lax
    from jax import numpy as jnp
    from jax.scipy.linalg import cho_solve

    # JAX uses single precision unless this is set before its first array
    jax.config.update("jax_enable_x64", True)
    tracker, mean, covariance = problem.started()
    filter_ = SigmaFilter(problem, tracker.state_names, jnp, cho_solve)

    def step(belief: Any, seen: Any) -> Any:
        belief = filter_.step(*belief, *seen)
        return belief, belief[0]

    scan = jax.jit(lambda belief, seen: lax.scan(step, belief, seen)[1])
    belief = (jnp.asarray(mean), jnp.asarray(covariance))
    seen = (jnp.asarray(problem.readings[WARM:]), jnp.asarray(problem.inputs[WARM:]))
    return lambda: np.asarray(scan(belief, seen))
