"""All estimators against golden trajectories of programs that share no code with them."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    LainiotisBank,
    LinearModel,
    MatrixFading,
    MultipleFading,
    Order,
    RandomWalkKalman,
    RecursiveLeastSquares,
    StateKalman,
    VariableForgetting,
    start,
)

GOLDEN = Path(__file__).parents[2] / "golden"
FILTERS = json.loads((GOLDEN / "filters.json").read_text())


def agree(values, expected):
    np.testing.assert_allclose(values, expected, rtol=1e-10, atol=1e-11)


def recursive_law(case):
    R1 = np.array(case["R1"])
    return {
        "rls": RecursiveLeastSquares(0.9375),
        "vff": VariableForgetting(5.0, 0.25),
        "joint": VariableForgetting(5.0, 0.25, joint=True),
        "nkf": RandomWalkKalman(R1, 0.375),
        "ckf": CorrectedKalman(R1, 0.375),
    }[case["law"]]


@pytest.mark.parametrize(
    "case",
    json.loads((GOLDEN / "estimators.json").read_text()),
    ids=lambda case: f"{case['law']}-{len(case['P0'])}",
)
def test_recursive_laws_agree_with_decimal_arithmetic_to_ten_digits(case):
    law, belief = recursive_law(case), start(len(case["P0"]), P0=case["P0"])
    kept = dict(zip(case["at"], case["kept"], strict=True))
    for t, (phi, y) in enumerate(zip(case["phi"], case["y"], strict=True)):
        belief = law.update(belief, np.array(phi), y)
        for name, value in kept.get(t, {}).items():
            agree(getattr(belief, name), value)


def state_law(case):
    model = LinearModel(*(case["model"][name] for name in "FHQR"))
    if case["search"] is None:
        return {"kalman": StateKalman, "filter 1": MultipleFading}[case["law"]](model)
    search = {name: float(v) for name, v in case["search"].items() if isinstance(v, str)}
    if case["law"] == "as printed":
        search |= {"normalised": False, "max_iterations": 5, "s_min": -math.inf, "s_max": math.inf}
    return MatrixFading(model, **search)


@pytest.mark.parametrize(
    "case", FILTERS["states"], ids=lambda case: f"{case['law']}-{len(case['x0'])}-{case['columns']}"
)
def test_state_space_filters_agree_with_decimal_arithmetic_to_ten_digits(case):
    law = state_law(case)
    belief = law.start(case["x0"], case["P0"])
    kept = dict(zip(case["at"], case["kept"], strict=True))
    adapted = 0
    for k, z in enumerate(case["z"]):
        belief = law.update(belief, z)
        adapted += bool((belief.fading != 1.0).any())
        for name, value in kept.get(k, {}).items():
            agree(getattr(belief, name), value)
    assert (adapted > 3) == (case["law"] != "kalman")


def fused(posterior, orders, thetas):
    """Return coefficients of nested candidates, the a's and the b's each in their block."""
    n, m = (max(order[i] for order in orders) for i in (0, 1))
    theta = np.zeros(n + m)
    for p, (own_n, own_m, _), own in zip(posterior, orders, thetas, strict=True):
        theta[:own_n] += p * np.array(own[:own_n])
        theta[n : n + own_m] += p * np.array(own[own_n:])
    return theta


@pytest.mark.parametrize("case", FILTERS["banks"])
def test_banks_agree_with_decimal_arithmetic_to_ten_digits(case):
    orders = case["orders"]
    settings = {name: case[name] for name in ("R", "P0", "Q", "floor")}
    bank = LainiotisBank([Order(*order) for order in orders], **settings)
    nested = len({d for _, m, d in orders if m}) == 1
    kept = dict(zip(case["at"], case["kept"], strict=True))
    for t, (y, u) in enumerate(case["samples"]):
        bank = bank.update(y, u)
        if t not in kept:
            continue
        posterior, thetas = kept[t]["posterior"], kept[t]["thetas"]
        best = int(np.argmax(posterior))
        agree(bank.posterior, posterior)
        agree(bank.prediction, kept[t]["prediction"])
        agree(bank.theta, fused(posterior, orders, thetas) if nested else thetas[best])
        assert bank.best == Order(*orders[best])
