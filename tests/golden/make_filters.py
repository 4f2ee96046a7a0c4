"""Write filters.json: state-space filters and Lainiotis banks in 60-digit decimals.

Run it by hand: ``python tests/golden/make_filters.py``. It shares no code with the package: all
matrices are whole, the covariance is corrected in the short form, slopes are differences of the
matrix T of BO17 (29), and a bank keeps its candidates apart, each with a regressor of its own.
"""

import json
import random
from decimal import Decimal, getcontext
from pathlib import Path

from make_estimators import ONE, covariance, kalman, plus, scaled, solved, times, turned

getcontext().prec = 60
ZERO = Decimal(0)
LIMIT = Decimal("3.841458820694124")  # the 95 % point of chi-square(1), in any table
SAMPLES = 30
KEPT = (0, 1, 2, 9, 19, 29)


def unit(n):
    return [[ONE if i == j else ZERO for j in range(n)] for i in range(n)]


def diagonal(values):
    return [
        [value if i == j else ZERO for j in range(len(values))] for i, value in enumerate(values)
    ]


def faded(model, J, s):
    """Return S J S + Q, BO17 (14)."""
    return plus(times(times(diagonal(s), J), diagonal(s)), model["Q"])


def gain(model, P):
    """Return K and the covariance of the innovation, BO17 (5) and (10)."""
    H = model["H"]
    S = plus(times(times(H, P), turned(H)), model["R"])
    return turned(solved(S, times(H, P))), S


def observed_factors(model, J, v):
    """Return the factors of BO17 (24)."""
    s, hidden = [ONE] * len(J), []
    for i in range(len(J)):
        rows = [r for r, row in enumerate(model["H"]) if row[i]]
        if not rows:
            hidden.append(i)
        for r in rows:
            h = model["H"][r][i]
            b = h * model["Q"][i][i] * h + model["R"][r][r]  # BO17 (18)
            square = (v[r][0] ** 2 / LIMIT - b) / (h**2 * J[i][i])
            s[i] = max(s[i], square.sqrt() if square > 0 else ONE)
    return s, hidden


def whitening(model, J, C, s):
    """Return all of T, BO17 (29), with the gain of the factors that are tried."""
    P = faded(model, J, s)
    return plus(times(P, turned(model["H"])), times(gain(model, P)[0], C), -ONE)


def squares(T):
    return sum(value * value for row in T for value in row)


def sought_factors(model, J, C, s, hidden, search):
    """Return the factors at the end of the descent, BO17 (30)-(31)."""
    slopes = {}
    for i in hidden:
        further = [value + (k == i) for k, value in enumerate(s)]
        slopes[i] = plus(whitening(model, J, C, further), whitening(model, J, C, s), -ONE)
    step = Decimal(search["tau"])
    if search.get("normalised", True):
        step /= max(squares(slope) for slope in slopes.values())
    first = value = squares(whitening(model, J, C, s))
    found = s
    for _ in range(search.get("max_iterations", 20)):
        T = whitening(model, J, C, found)
        moved = list(found)
        for i, slope in slopes.items():
            gradient = 2 * sum(
                a * b for r, q in zip(T, slope, strict=True) for a, b in zip(r, q, strict=True)
            )
            moved[i] = found[i] - step * gradient
            if search["s_min"] is not None:
                moved[i] = min(max(moved[i], Decimal(search["s_min"])), Decimal(search["s_max"]))
        found, before, value = moved, value, squares(whitening(model, J, C, moved))
        if abs(value - before) <= Decimal(search["delta"]):
            break
    return found if value <= first else s


def filtered(model, law, search, x, P, observations):
    """Yield what a state-space filter believes after each observation."""
    total = None
    for k, z in enumerate(observations, 1):
        x, J = times(model["F"], x), times(times(model["F"], P), turned(model["F"]))
        v = plus(z, times(model["H"], x), -ONE)
        square = times(v, turned(v))
        total = square if total is None else plus(total, square)
        s = [ONE] * len(x)
        if law != "kalman":
            s, hidden = observed_factors(model, J, v)
            if search and hidden:
                s = sought_factors(model, J, scaled(total, ONE / k), s, hidden, search)
        P = faded(model, J, s)
        K, S = gain(model, P)
        x, P = plus(x, times(K, v)), plus(P, times(times(K, model["H"]), P), -ONE)
        yield {
            "x": [value for (value,) in x],
            "P": P,
            "innovation": [value for (value,) in v],
            "innovation_cov": S,
            "fading": s,
            "mean_square": scaled(total, ONE / k),
        }


def model_of(rng, n, columns):
    """Return a model with a full F and Q; row r of H observes ``columns[r]``, or all states."""
    H = [[ZERO] * n for _ in columns]
    for row, c in zip(H, columns, strict=True):
        for i in range(n):
            if c is None or c == i:
                row[i] = Decimal(rng.choice([-1, 1]) * rng.randint(4, 16)) / 8
    F = [[Decimal(rng.randint(-6, 6) + 8 * (i == j)) / 16 for j in range(n)] for i in range(n)]
    Q, R = scaled(covariance(rng, n), ONE / 64), scaled(covariance(rng, len(columns)), ONE / 8)
    return {"F": F, "H": H, "Q": Q, "R": R}


PRINTED = {"normalised": False, "max_iterations": 5, "s_min": None, "s_max": None}
SEARCHES = {
    "filter 2": {"tau": "0.1", "delta": "1e-4", "s_min": "0", "s_max": "1"},
    "bounded": {"tau": "0.25", "delta": "1e-9", "s_min": "0.5", "s_max": "1.25"},
    "as printed": {"tau": "0.0078125", "delta": "1e-4", **PRINTED},
}
SHAPES = ((2, [1]), (3, [2, 0]), (4, [1, 3]), (4, [2, 2]), (2, [1, 0]))


def state_cases(rng):
    """Yield the cases of the state-space filters."""
    laws = [("filter 1", shape) for shape in SHAPES]
    laws += [(law, shape) for law in SEARCHES for shape in SHAPES]
    laws += [("kalman", (n, [None] * m)) for n, m in ((1, 1), (3, 2), (2, 4))]
    for law, (n, columns) in laws:
        model, P0 = model_of(rng, n, columns), covariance(rng, n)
        x0 = [Decimal(rng.randint(-16, 16)) / 8 for _ in range(n)]
        observations = [
            [[Decimal(rng.randint(-640, 640)) / 128] for _ in columns] for _ in range(SAMPLES)
        ]
        search = SEARCHES.get(law)
        trace = list(filtered(model, law, search, [[x] for x in x0], P0, observations))
        yield {
            "law": law,
            "columns": columns,
            "search": search,
            "model": model,
            "x0": x0,
            "P0": P0,
            "z": [[value for (value,) in z] for z in observations],
            "at": KEPT,
            "kept": [trace[k] for k in KEPT],
        }


def banked(orders, samples, R, P0, Q, floor):
    """Yield posterior, prediction and thetas of a bank, as ALF (5)-(8) have them."""
    sizes = [n + m for n, m, _ in orders]
    beliefs = [([[ZERO]] * p, scaled(unit(p), P0)) for p in sizes]
    prior, ys, us = [ONE / len(orders)] * len(orders), [], []
    for y, u in samples:
        us.append(u)
        weights, prediction = [], ZERO
        for i, (n, m, d) in enumerate(orders):
            phi = [[-ys[-j]] if j <= len(ys) else [ZERO] for j in range(1, n + 1)]
            phi += [[us[-j]] if j <= len(us) else [ZERO] for j in range(d, d + m)]
            theta, P = beliefs[i]
            theta, P, e, S, _ = kalman(theta, P, phi, y, scaled(unit(sizes[i]), Q), R, False)
            beliefs[i] = theta, P
            prediction += prior[i] * (y - e)
            weights.append(prior[i] * (-e * e / S / 2).exp() / S.sqrt())
        raised = [max(w / sum(weights), floor) for w in weights]
        prior = [w / sum(raised) for w in raised]
        ys.append(y)
        thetas = [[value for (value,) in theta] for theta, _ in beliefs]
        yield {"posterior": prior, "prediction": prediction, "thetas": thetas}


def bank_cases(rng):
    """Yield the cases of the bank: delays that differ, and candidates that are nested."""
    mixed = [(1, 1, 1), (2, 1, 2), (3, 2, 1), (2, 0, 1), (0, 2, 3)]
    nested = [(1, 1, 2), (2, 3, 2), (3, 1, 2), (1, 0, 1)]
    for orders in (mixed, nested):
        for Q, floor in (("0", "0.001"), ("0.015625", "0"), ("0", "0.1875")):
            ys, us, samples = [ZERO] * 2, [ZERO] * 2, []
            for _ in range(2 * SAMPLES):
                us.append(Decimal(rng.randint(-128, 128)) / 64)
                noise = Decimal(rng.randint(-64, 64)) / 128
                y = Decimal("1.2") * ys[-1] - ys[-2] / 2 + Decimal("0.8") * us[-2] + noise
                ys.append(Decimal(float(round(y, 6))))
                samples.append((ys[-1], us[-1]))
            R, P0 = Decimal("0.1875"), Decimal(9)
            at = (0, 1, 2, 5, 19, 39, 59)
            trace = list(banked(orders, samples, R, P0, Decimal(Q), Decimal(floor)))
            yield {
                "orders": orders,
                "R": R,
                "P0": P0,
                "Q": Decimal(Q),
                "floor": Decimal(floor),
                "samples": samples,
                "at": at,
                "kept": [trace[k] for k in at],
            }


def main():
    rng = random.Random(20170421)
    cases = {"states": list(state_cases(rng)), "banks": list(bank_cases(rng))}
    text = json.dumps(cases, default=float, separators=(",", ":"))
    for key in ('{"law"', '{"orders"', '"banks"'):
        text = text.replace(key, f"\n{key}")
    Path(__file__).with_name("filters.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
