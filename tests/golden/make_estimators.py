"""Write estimators.json: trajectories of the recursive estimators in 60-digit decimals.

Run it by hand: ``python tests/golden/make_estimators.py``. It shares no code with the package and
none of its shortcuts: matrices are lists of lists, the covariance is not symmetrised, and the
correction is the long ratio O21 (26), with the inverse of P and with R2.
"""

import json
import random
from decimal import Decimal, getcontext
from pathlib import Path

getcontext().prec = 60
ONE = Decimal(1)


def times(A, B):
    return [
        [sum(a * b for a, b in zip(row, col, strict=True)) for col in zip(*B, strict=True)]
        for row in A
    ]


def plus(A, B, factor=ONE):
    return [[a + factor * b for a, b in zip(r, s, strict=True)] for r, s in zip(A, B, strict=True)]


def scaled(A, factor):
    return [[factor * a for a in row] for row in A]


def turned(A):
    return [list(column) for column in zip(*A, strict=True)]


def solved(A, b):
    """Return x of A x = b by Gauss-Jordan elimination with pivots."""
    rows = [[*row, *right] for row, right in zip(A, b, strict=True)]
    n = len(rows)
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for k in range(n):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[n:] for row in rows]


def gain(P, phi, noise):
    """Return the column K and S for a regressor column."""
    S = times(turned(phi), times(P, phi))[0][0] + noise
    return scaled(times(P, phi), ONE / S), S


def reduced(P, K, phi):
    return plus(P, times(K, times(turned(phi), P)), -ONE)


def least_squares(theta, P, phi, y, forgetting):
    e = y - times(turned(phi), theta)[0][0]
    K, S = gain(P, phi, forgetting)
    return (
        plus(theta, scaled(K, e)),
        scaled(reduced(P, K, phi), ONE / forgetting),
        e,
        S,
        ONE / forgetting,
    )


def variable(theta, P, phi, y, Sigma0, least):
    e = y - times(turned(phi), theta)[0][0]
    K, S = gain(P, phi, ONE)
    unexplained = ONE - times(turned(phi), K)[0][0]
    forgetting = max(least, ONE - unexplained * e * e / Sigma0)
    return (
        plus(theta, scaled(K, e)),
        scaled(reduced(P, K, phi), ONE / forgetting),
        e,
        S,
        ONE / forgetting,
    )


def joint(theta, P, phi, y, Sigma0, least):
    """Halve the interval of lambda until (12) and (14) hold as printed, both at once."""
    e = y - times(turned(phi), theta)[0][0]
    low, high = Decimal(0), ONE
    for _ in range(180):
        middle = (low + high) / 2
        K, _ = gain(P, phi, middle)
        asked = ONE - (ONE - times(turned(phi), K)[0][0]) * e * e / Sigma0
        low, high = (middle, high) if asked > middle else (low, middle)
    return least_squares(theta, P, phi, y, max(least, low))


def kalman(theta, P, phi, y, R1, R2, corrected):
    e = y - times(turned(phi), theta)[0][0]
    K, S = gain(P, phi, R2)
    new = plus(theta, scaled(K, e))
    inflation = ONE
    if corrected:
        moved = plus(new, theta, -ONE)
        left = y - times(turned(phi), new)[0][0]
        ratio = times(turned(moved), solved(P, moved))[0][0] + left * left / R2
        inflation = max(ONE, ratio / (len(theta) + 1))
    return new, plus(scaled(reduced(P, K, phi), inflation), R1), e, S, inflation


def plants(rng, n, samples):
    """Yield regressors and outputs of a plant whose parameters jump half-way."""
    theta = [Decimal(rng.randint(-200, 200)) / 100 for _ in range(n)]
    for t in range(samples):
        if t == samples // 2:
            theta = [-value for value in theta]
        phi = [Decimal(rng.randint(-3000, 3000)) / 1000 for _ in range(n)]
        noise = Decimal(rng.randint(-1000, 1000)) / 1000
        yield phi, sum(p * value for p, value in zip(phi, theta, strict=True)) + noise


def covariance(rng, n):
    """Return a positive definite matrix with entries that floats hold exactly."""
    A = [[Decimal(rng.randint(-8, 8)) / 8 for _ in range(n)] for _ in range(n)]
    unit = [[Decimal(i == j) for j in range(n)] for i in range(n)]
    return plus(times(A, turned(A)), unit)


def main():
    rng = random.Random(20210804)
    cases = []
    for n in (1, 2, 4):
        P0, R1 = covariance(rng, n), scaled(covariance(rng, n), Decimal(1) / 1024)
        data = list(plants(rng, n, 60))
        laws = {
            "rls": lambda *a: least_squares(*a, Decimal("0.9375")),
            "vff": lambda *a: variable(*a, Decimal(5), Decimal("0.25")),
            "joint": lambda *a: joint(*a, Decimal(5), Decimal("0.25")),
            "nkf": lambda *a, R1=R1: kalman(*a, R1, Decimal("0.375"), False),
            "ckf": lambda *a, R1=R1: kalman(*a, R1, Decimal("0.375"), True),
        }
        for name, law in laws.items():
            theta, P, trace = [[Decimal(0)] for _ in range(n)], P0, []
            for phi, y in data:
                phi, y = [[Decimal(float(p))] for p in phi], Decimal(float(y))
                theta, P, e, S, inflation = law(theta, P, phi, y)
                trace.append(
                    {
                        "theta": [float(v) for (v,) in theta],
                        "P": [[float(v) for v in row] for row in P],
                        "innovation": float(e),
                        "innovation_var": float(S),
                        "inflation": float(inflation),
                    }
                )
            cases.append(
                {
                    "law": name,
                    "P0": [[float(v) for v in row] for row in P0],
                    "R1": [[float(v) for v in row] for row in R1],
                    "phi": [[float(p) for p in phi] for phi, _ in data],
                    "y": [float(y) for _, y in data],
                    "kept": [trace[t] for t in (0, 1, 2, 9, 29, 30, 31, 44, 59)],
                    "at": [0, 1, 2, 9, 29, 30, 31, 44, 59],
                }
            )
    path = Path(__file__).with_name("estimators.json")
    path.write_text(
        json.dumps(cases, indent=None, separators=(",", ":")).replace('{"law"', '\n{"law"') + "\n"
    )


if __name__ == "__main__":
    main()
