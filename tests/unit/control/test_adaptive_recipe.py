"""The bank against a plain one: one filter after the other, matrix by matrix."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.coasting import power_for
from thermoctl.control.adaptive.constants import Plants

SHAPES = [(0.18, 0.31, 0.51), (0.10, 0.75, 0.15), (0.05, 0.10, 0.85), None]


@dataclass
class Filter:
    """One hypothesis, with everything in K, s and per second."""

    lag_s: float
    shape: tuple[float, float, float] | None
    h: float
    q: float = 0.0
    q_mean: float = 0.0
    ln_w: float = 0.0
    x: np.ndarray = field(default_factory=lambda: np.zeros(4))
    P: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)))
    K: np.ndarray = field(default_factory=lambda: np.zeros(4))
    S: float = 0.0
    good: tuple[np.ndarray, float] = (np.zeros(4), 0.0)  # K and S that are kept at rest
    sure: bool = False
    knew: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)))

    def __post_init__(self):
        pipe = self.shape is None  # and what is beyond heater and sensor, 20 s of both, is dead
        shares = SHAPES[0] if pipe else self.shape
        dead_s, self.t1_s, self.t2_s = (share * self.lag_s for share in shares)
        if pipe and self.t1_s + self.t2_s > 20.0:
            self.t1_s, self.t2_s = 20.0 * 0.31 / 0.82, 20.0 * 0.51 / 0.82
            dead_s = self.lag_s - 20.0
        self.nd = round(dead_s / self.h)

    def begin(self, y):
        self.x = np.array([y, y, 0.0, 0.002])
        self.P = np.diag([1.0, 1.0, 0.001**2, 0.15**2])
        self.P[0, 1] = self.P[1, 0] = 0.98

    def advance(self, powers):
        before, u, decay = self.q, powers[self.nd], math.exp(-self.h / self.t1_s)
        self.q = u + decay * (before - u)
        self.q_mean = u + self.t1_s * (1.0 - decay) * (before - u) / self.h  # integral over h

    def arrives(self, t_s):
        return t_s - self.h <= 2 * self.lag_s < t_s

    def predict(self, away, t_s, steady, above, room):
        a = 1.0 - math.exp(-self.h / self.t2_s)
        c = self.h - self.t2_s * a  # of water that warms by 1 K/s, shown at the end of h
        F = np.array([[1, 0, -self.h, self.h * self.q_mean], [a, 1 - a, -c, c * self.q_mean],
                      [0, 0, 1, 0], [0, 0, 0, 1]])  # fmt: skip
        b = max(self.x[3], 1e-4)
        restless = 1 + 5 * away
        noise = [(0.08 * b) ** 2, 0.003**2, (0.0008 * b * restless) ** 2, (2e-4 * b) ** 2]
        before, lost = self.x[0], self.x[2]
        self.x = F @ self.x
        self.grow(self.x[0] - before, max(above, room))
        if steady:
            return
        self.knew = self.P
        G = np.diag([1, 1, self.x[2] / lost if above > room and lost > 0 else 1, 1])
        self.P = G @ F @ self.P @ F.T @ G + self.h * np.diag(noise)
        if self.arrives(t_s):
            ridge = np.array([0, 0, 1, 1]) * 0.08 * self.x[3] * self.q
            self.P = self.P + np.outer(ridge, ridge)

    def grow(self, moved, room):
        self.x[2] += max(self.x[2], 0.0) * math.tanh(moved / room)  # what is warmer loses more

    def inflate(self, nu, R):
        root = math.sqrt(max(1.0, nu**2 / (self.P[1, 1] + R)))
        D = np.diag([root, root, 1.0, 1.0])
        self.P = D @ self.P @ D

    def correct(self, y, R, u_min, limit_loss, e, settling, steady):
        nu = y - self.x[1]
        if not steady:
            self.S = self.P[1, 1] + R
            self.K = self.P[:, 1] / self.S
            self.sure = self.P[3, 3] <= (0.1 * self.x[3]) ** 2
            self.K[3] *= e if self.sure else 1.0
        K, S = self.good if steady else (self.K, self.S)
        self.x = self.x + K * nu
        if settling:
            self.grow(K[0] * nu, room=settling)
        if not steady:
            A = np.eye(4) - np.outer(K, [0, 1, 0, 0])
            self.P = A @ self.P @ A.T + R * np.outer(K, K)
            self.P = (self.P + self.P.T) / 2
        self.x[3] = max(self.x[3], 2e-5)
        if not steady:
            self.x[3] = min(self.x[3], 60.0 / self.lag_s)
        if limit_loss and not steady:
            self.x[2] = min(max(self.x[2], (u_min - 0.5) * self.x[3]), 0.95 * self.x[3])
        return nu, S

    def coasting(self, powers, u_min, u_max):
        T, _, d, beta = self.x
        u_ss = min(max(d / beta, u_min), u_max)
        under_way = sum(powers[i] - u_ss for i in range(self.nd))
        coasting = T + beta * (self.t1_s * (self.q - u_ss) + self.h * under_way)
        heater = beta * self.t1_s
        return u_ss, coasting, self.lag_s, beta, heater, self.q - u_ss, self.P[3, 3]


class PlainBank:
    """The recipe step by step, and nothing but it."""

    def __init__(self, h=1.0, u_min=0.0, u_max=1.0, kappa=0.6, room=40.0):
        self.room, self.coldest, self.above, self.hot = room, math.inf, 0.0, 0
        self.h, self.u_min, self.u_max, self.kappa = h, u_min, u_max, kappa
        lags = [3.0 * 50.0 ** (i / 23.0) for i in range(24)]
        self.filters = [Filter(lag_s, shape, h) for lag_s in lags for shape in SHAPES]
        self.powers = [0.0] * 4000
        self.R_hat, self.u_mean, self.n, self.k = 0.001, 0.0, 0, -1
        self.y1 = self.y2 = math.nan
        self.outside, self.silent_until_s = 0, -math.inf
        self.calm, self.sums, self.disturbed = 0, [0.0, 0.0], False
        self.learnt_from_s = -math.inf
        self.misses, self.means, self.colour, self.most = [], np.array([0.0, 0.0, 1e-3]), 0.0, 1.0
        self.missed, self.bound, self.settled, self.kept = (
            0,
            None,
            False,
            0,
        )  # K S of the loss, and its standing

    def step(self, y, applied, r):
        u = min(max(applied, self.u_min), self.u_max)
        self.powers = [u, *self.powers[:-1]]
        valid = math.isfinite(y)
        e = min(max((abs(u - self.u_mean) - 0.05) / 0.05, 0.0), 1.0)
        if self.k >= 0:
            w = np.exp([each.ln_w for each in self.filters])
            rate = w @ [1.0 / (2.0 * each.lag_s) for each in self.filters] / w.sum()
        else:
            rate = math.inf
        self.u_mean += self.h * min(rate, 0.02, 1.0 / self.h) * (u - self.u_mean)
        for each in self.filters:
            each.advance(self.powers)
        if self.k < 0 and not valid:
            return 0.0
        if self.k < 0:
            for each in self.filters:
                each.begin(y)
        self.k += 1
        self.unmoved = False  # gain and weights are what they were
        away = abs(u - self.told[0]) if self.k > 0 else 0.0
        self.steady = self.settled and self.kept < 14 and e == 0 and away < 0.15
        self.steady &= not any(each.arrives(self.k * self.h) for each in self.filters)
        for each in self.filters:
            each.predict(away, self.k * self.h, self.steady, self.above, self.room)
        w = np.exp([each.ln_w for each in self.filters])
        expected = w @ [each.x[1] for each in self.filters] / w.sum()
        self.surprise = y - expected if self.k > 0 else math.nan
        before, self.bound, self.settled = (self.settled, self.bound), None, False
        if valid:
            self.meet(y, e, away, *before)
        return self.decide(r)

    def meet(self, y, e, away, settled, bound):
        if self.n >= 2:
            second = min((y - 2 * self.y1 + self.y2) ** 2 / 6, 9 * max(self.R_hat, 0.001))
            self.R_hat += (second - self.R_hat) * max(0.005, 1 / (self.n + 5))
            self.coldest = min(self.coldest, max(y, self.y1, self.y2))  # no outlier lasts three
        self.y1, self.y2, above = y, self.y1, self.above
        cools = self.u_min < 0.0  # and may well have been colder than its room
        self.above = 0.0 if cools else 0.9 * (y - self.coldest)
        self.hot += self.above > self.room
        self.n += 1
        likeliest = max(self.filters, key=lambda each: each.ln_w)  # the first of equals
        nu_m, tempered = y - likeliest.x[1], 1.0
        if self.n > 20 and self.k * self.h >= 30 and abs(nu_m) < 0.5:
            tempered = self.listen(nu_m, self.k * self.h < self.silent_until_s - 1e-6)
        for each in self.filters:
            each.ln_w *= tempered
        R = max(self.R_hat, 1e-5) + 2.0 * self.colour * (self.means[2] - self.means[0] ** 2)
        S_m = likeliest.good[1] if self.steady else likeliest.P[1, 1] + R
        beyond = self.n - 1 >= 20 and nu_m**2 > 25 * S_m
        if beyond and self.k * self.h >= self.learnt_from_s - 1e-6:
            beyond = not self.foreseen(y, R)
        self.outside = self.outside + 1 if beyond else 0
        if self.outside in (1, 2):
            return
        jumped = self.outside > 2
        found = False
        if self.k * self.h >= self.learnt_from_s - 1e-6:
            nu = nu_m / math.sqrt(S_m)
            found = self.drifts(nu, e == 0 and away < 0.15, likeliest.lag_s)
        if found and not jumped:
            for each in self.filters:
                each.P[2, 2] += (0.05 * each.x[3]) ** 2
                each.P[2:, 2:] += np.outer(0.1 * each.x[2:], 0.1 * each.x[2:])
        if jumped:
            self.silent_until_s = self.k * self.h + 5 * likeliest.lag_s
        if jumped or found:
            self.calm, self.sums, self.disturbed = 0, [0.0, 0.0], True
            self.learnt_from_s = self.k * self.h + 5 * likeliest.lag_s
        self.steady &= not (jumped or found)
        heard = not jumped and self.k >= 4 and max(self.sums) <= 3
        heard &= self.k * self.h >= max(self.silent_until_s, self.learnt_from_s)
        settling = self.k * self.h < self.silent_until_s and max(self.room, above)
        shares = [math.exp(each.ln_w) for each in self.filters]
        told = []
        for each in self.filters:
            if jumped:
                each.inflate(nu_m, R)
            limited = self.k * self.h > 60
            nu, S = each.correct(y, R, self.u_min, limited, e, settling, self.steady)
            if heard:
                news = (1 - self.colour) / (1 + self.colour)
                each.ln_w -= 0.5 * e * news * (math.log(S) + min(nu**2 / S, 9))
            told.append(math.exp(-0.5 * (math.log(S) + min(nu**2 / S, 9))))
        for j, each in enumerate(self.filters if settling and not jumped else []):
            family = range(j - j % 4, j - j % 4 + 4)  # all shapes of one lag
            kept = sum(shares[i] for i in family) / sum(shares[i] * told[i] for i in family)
            each.ln_w += math.log(told[j] * kept)
        best = max(each.ln_w for each in self.filters)
        for each in self.filters:
            each.ln_w = max(each.ln_w - best, -30.0)
        self.unmoved = self.steady and tempered == 1.0
        from_s = self.learnt_from_s - 1e-6
        quiet = e == 0 and away < 0.15 and not self.disturbed and self.k * self.h >= from_s
        if self.k * self.h >= from_s and bound is not None:
            self.kept, self.settled, self.bound = self.kept + 1, settled, bound
            self.missed += self.steady
        if quiet and not self.steady and (bound is None or self.kept >= 14):
            self.settle(self.filters.index(likeliest), bound)

    def foreseen(self, y, R):
        """Tell whether the likeliest, were `y` to count in full, was within five deviations."""
        told = []
        for each in self.filters:
            S = each.good[1] if self.steady else each.P[1, 1] + R
            nis = (y - each.x[1]) ** 2 / S
            told.append((each.ln_w - 0.5 * (math.log(S) + min(nis, 9)), nis))
        heard = any(each.ln_w < 0 for each in self.filters)
        return heard and max(told, key=lambda one: one[0])[1] <= 25

    def settle(self, m, before):
        """See whether the gains have come to stand; if so, they are good for fourteen samples."""
        for each in self.filters if before is not None and self.missed else ():
            share = min(max(each.P[2, 2] / each.knew[2, 2], 0.97), 1.03)
            each.P[3, 3] += self.missed * max(each.P[3, 3] - each.knew[3, 3], 0.0)
            scale = np.diag([1.0, 1.0, share ** (self.missed / 2), 1.0])
            each.P, each.K = scale @ each.P @ scale, scale @ each.K
        for each in self.filters:
            each.good = each.K, each.S
        self.missed = self.kept = 0
        self.bound = [each.K[2] * each.S for each in self.filters]
        if before is not None:
            share = np.exp([each.ln_w for each in self.filters])
            share = share @ [each.sure for each in self.filters] / share.sum()
            moved = abs(self.bound[m] - before[m])
            self.settled = share >= 0.9 and moved <= 0.05 * abs(self.bound[m])

    def listen(self, nu, silent):
        limit = 3 * math.sqrt(max(self.means[2], 1e-5))
        nu, last = min(max(nu, -limit), limit), self.misses[-1] if self.misses else 0.0
        news = np.array([nu, nu * last, nu * nu])
        self.means = self.means + (news - self.means) * max(1e-3, 1 / (len(self.misses) + 5))
        self.misses.append(nu)
        mean, product, square = self.means
        rho = (product - mean**2) / (square - mean**2)
        self.colour = min(max((rho - 0.4) / 0.6, 0.0), 1.0)
        larger = 1 + 2 * self.colour * (square - mean**2) / max(self.R_hat, 1e-5)
        before, self.most = self.most, self.most if silent else max(self.most, larger)
        return before / self.most

    def drifts(self, nu, still, lag_s):
        self.calm = self.calm + 1 if still or max(self.sums) > 3 else 0
        rested = self.calm >= max(3 * lag_s / self.h, 20)
        self.disturbed &= not rested
        counts = self.disturbed or rested
        self.sums = [
            counts * max(s + by - 0.5, 0.0) for s, by in zip(self.sums, (nu, -nu), strict=True)
        ]
        return max(self.sums) > 14

    def decide(self, r):
        w = np.exp([each.ln_w for each in self.filters])
        rows = [each.coasting(self.powers, self.u_min, self.u_max) for each in self.filters]
        rows = np.array(rows)
        *told, variance = w @ rows / w.sum()
        self.told = [*told[:3], *self.told[3:5], told[5]] if self.unmoved else told
        u_ss, coasting, lag, beta, heater, surplus = self.told
        spread = math.sqrt(w @ (rows[:, 1] - coasting) ** 2 / w.sum())
        lag_sd = math.sqrt(w @ (rows[:, 2] - lag) ** 2 / w.sum())
        mistaken = beta * math.hypot(lag_sd, 1.0, 0.05 * lag)
        heavy = min(max(mistaken / 0.16, 1.0), 3.0)
        Tc = max(3.0, 1.5 * self.h, self.kappa * heavy * lag)
        tau, before = 0.4 * Tc, self.powers[0]
        aim = coasting + beta * tau * (before - u_ss)
        swing = min(max(beta * lag * (self.u_max - self.u_min) / 1.2, 1.0), 3.0)
        moving = 1.0 + 0.4 * (swing - 2.0)  # share of the heater's heat that counts
        aim -= heater * surplus
        size = abs(surplus)
        aim += heater * max(moving * size, 2.2 * min(size, 0.08)) * (1 if surplus > 0 else -1)
        error, doubt = r - aim, max(spread - 0.05, 0.0)
        if error > 0:
            error = max(error - doubt, 0.0)
        elif self.u_min < 0:
            error = min(error + doubt, 0.0)
        doubted = beta + max(min(math.sqrt(variance), 0.05) - 0.25 * beta, 0.0)
        wanted = u_ss + error / (doubted * Tc)
        u = before + (wanted - before) * self.h / (self.h + tau)
        return min(max(u, self.u_min), self.u_max)


def eventful(samples, h, seed):
    """Yield readings of a plant with lags that is disturbed in every way; None: what was asked."""
    rng = np.random.default_rng(seed)
    T = z = 25.0
    q, gain, loss = 0.0, 0.036, 0.009 / 37.5

    def reading(k, u):
        nonlocal T, z, q, gain, loss
        if k == int(0.45 * samples):
            T -= 3.3  # cold water
        if k == int(0.6 * samples):
            gain *= 2.0  # half the water gone
        if k == int(0.93 * samples):
            loss *= 3.0  # a draught
        q += (1 - math.exp(-h / 14)) * (u - q)
        T += h * (gain * q - loss * T) + 0.002 * math.sqrt(h) * rng.standard_normal()
        z += (1 - math.exp(-h / 6)) * (T - z)
        y = z + 0.015 * rng.standard_normal()
        y += 1.5 * (k in (20, 25))  # before the gate and just behind it
        y -= 0.05 * max(0, min(k, 90) - 40)  # a loss beyond full power, also before it is limited
        if k < 3 or k % 97 == 40 or 0.3 * samples < k < 0.3 * samples + 15:
            return math.nan  # gaps, at the start as well
        return y + (20.0 if k % 131 == 60 else 0.0) + (0.4 if k % 233 in (80, 81) else 0.0)

    return reading


@pytest.mark.parametrize(
    ("h", "u_min", "samples", "room"),
    [
        pytest.param(1.0, 0.0, 2500, 40.0, marks=pytest.mark.slow),
        (5.0, 0.0, 150, 40.0),
        (5.0, 0.0, 150, 6.0),
        pytest.param(5.0, 0.0, 500, 40.0, marks=pytest.mark.slow),
        pytest.param(0.4, -0.3, 600, 40.0, marks=pytest.mark.slow),
        pytest.param(5.0, -0.3, 200, 6.0, marks=pytest.mark.slow),
    ],
)
def test_every_step_is_that_of_filters_run_one_by_one(h, u_min, samples, room):
    bank = Bank(h, u_min, plants=Plants(room_k=room))
    plain = PlainBank(h, u_min, room=room)
    belief, reading = bank.start()._replace(twin=None), eventful(samples, h, seed=7)
    u, jumps, drifts, saturated, largest = 0.0, 0, 0, 0, 0.0
    for k in range(samples):
        r = 37.5 if k < 0.8 * samples else 40.0
        y = reading(k, u)
        applied = u + 0.7 * (0.5 * samples < k < 0.5 * samples + 9)  # not what was asked for
        applied *= not 35 < k < 90
        belief = bank.observe(belief, y, applied)
        expected = plain.step(y, applied, r)
        if belief.outlook is None:
            assert expected == 0.0
            continue
        u = power_for(belief.outlook, r, 0.6, h, bank.bounds, belief.path.powers[0])
        jumps += belief.gate.jumped
        drifts += belief.drifting.silent_until > k
        saturated += u in bank.bounds
        told = (belief.outlook.holding_power, belief.outlook.coasting_c, belief.outlook.lag_s,
                belief.outlook.gain, belief.outlook.heater_k, belief.outlook.surplus)  # fmt: skip
        largest = max(largest, abs(u - expected), *np.abs(np.subtract(told, plain.told)))
        assert belief.surprise_k == pytest.approx(plain.surprise, abs=1e-9, nan_ok=True)
        per_period = np.array([1.0, 1.0, h, h])
        P = np.array([each.P * np.outer(per_period, per_period) for each in plain.filters])
        x = np.array([each.x * per_period for each in plain.filters])
        expected_block = np.concatenate((P, x[:, :, None]), axis=2).transpose(1, 2, 0)
        block_error = np.abs(belief.block - expected_block) / (1.0 + np.abs(expected_block))
        weight_error = np.abs(belief.weights.log - [each.ln_w for each in plain.filters])
        largest = max(largest, block_error.max(), weight_error.max())
    print(
        f"jumps {jumps}, drifts {drifts}, saturated {saturated}, largest difference {largest:.1e}"
    )
    assert jumps > 0
    assert drifts > 0 or h < 1.0  # which is not at rest for long enough
    assert saturated > 0
    assert (plain.hot > 50) == (room < 40.0 and u_min == 0.0)
    assert largest < 1e-9
