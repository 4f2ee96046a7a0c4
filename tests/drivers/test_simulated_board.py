"""The simulated board: it keeps the clock's time, its dead-man cuts, and it tells the truth."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from thermoctl.errors import BoardConfigError, FaultError, LinkError, Refused
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.ports import Board, Simulated
from thermoctl.signals import Quality
from thermoctl_drivers.simulated import SimulatedBoard, SimulatedSettings

LM335_AT_5_V = Sensor(LM335, reference_v=5.0)
SEED_OF_A_SLOW_ELEMENT = 2


class HandClock:
    """Time that passes by hand."""

    def __init__(self, t_s: float = 1000.0) -> None:
        self.t_s = t_s

    def now_s(self) -> float:
        return self.t_s

    def sleep_until(self, t_s: float) -> None:
        self.t_s = max(self.t_s, t_s)


def board_on(clock: HandClock, **settings: object) -> SimulatedBoard:
    board = SimulatedBoard(SimulatedSettings(**settings), None, clock)
    board.open(clock.t_s + 1.0)
    return board


def read(board: SimulatedBoard, clock: HandClock):
    raw = board.read(clock.t_s + 0.5).get("temperature")
    return LM335_AT_5_V.measure(raw, clock.t_s)


def write(board: SimulatedBoard, clock: HandClock, drive: float, valid_for_s: float = 2.5):
    return board.write({"heater": drive}, valid_for_s, clock.t_s + 0.5)


def run(seconds: int, drive: float, **settings: object) -> list[tuple[float, float]]:
    clock = HandClock()
    board, lived = board_on(clock, **settings), []
    for _ in range(seconds):
        clock.t_s += 1.0
        lived.append((board.read(clock.t_s)["temperature"].counts, board.truth()["heater_w"]))
        write(board, clock, drive)
    return lived


def test_it_is_a_board_and_it_is_simulated():
    board: Board = SimulatedBoard(SimulatedSettings(), None, HandClock())
    assert isinstance(board, Simulated)
    assert board.capabilities.dead_man
    assert SimulatedBoard.Settings is SimulatedSettings


def test_it_reads_what_the_water_has():
    clock = HandClock()
    board = board_on(clock, initial_c=37.5, bits=16)
    measurement = read(board, clock)
    assert measurement.quality is Quality.GOOD
    assert measurement.t_s == clock.t_s
    assert measurement.temperature_c == pytest.approx(37.5, abs=0.1)


def test_a_sample_is_the_sum_of_a_burst_and_is_counted():
    clock = HandClock()
    board = board_on(clock, conversions=64, bits=12)
    first, second = (board.read(clock.t_s)["temperature"] for _ in range(2))
    assert first.full_scale == 64 * 4096
    assert second.sequence == first.sequence + 1


def test_equal_seeds_give_equal_runs_to_the_last_count():
    assert run(60, 0.6, seed=3) == run(60, 0.6, seed=3)
    assert run(60, 0.6, seed=3) != run(60, 0.6, seed=4)


def test_the_water_warms_as_the_clock_goes_on():
    clock = HandClock()
    board = board_on(clock)
    for _ in range(120):
        write(board, clock, 1.0)
        clock.t_s += 1.0
    read(board, clock)
    truth = board.truth()
    assert 28.0 < truth["true_temperature_c"] < 30.0
    assert truth["energy_j"] == pytest.approx(120 * 1500.0, rel=0.05)


def test_without_a_fresh_write_the_dead_man_cuts_the_heater():
    clock = HandClock()
    board = board_on(clock, dead_man_s=2.5)
    write(board, clock, 1.0, valid_for_s=60.0)
    clock.t_s += 100.0
    read(board, clock)
    assert board.truth()["heater_w"] == 0.0
    assert board.truth()["energy_j"] == pytest.approx(2.5 * 1500.0, rel=0.05)
    assert board.health().counters["dead_man"] == 1


def test_a_command_that_expires_earlier_than_the_dead_man_is_obeyed_until_then():
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 1.0, valid_for_s=1.0)
    clock.t_s += 10.0
    read(board, clock)
    assert board.truth()["energy_j"] == pytest.approx(1500.0, rel=0.05)


def test_reading_alone_does_not_re_arm_the_dead_man():
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 1.0)
    for _ in range(20):
        clock.t_s += 0.5
        read(board, clock)
    assert board.truth()["energy_j"] == pytest.approx(2.5 * 1500.0, rel=0.05)


def test_fresh_writes_keep_the_heater_on():
    clock = HandClock()
    board = board_on(clock)
    for _ in range(20):
        write(board, clock, 1.0)
        clock.t_s += 1.0
    read(board, clock)
    assert board.truth()["heater_w"] > 1400.0
    assert board.health().counters["dead_man"] == 0


@pytest.mark.parametrize("valid_for_s", [math.nan, -1.0, 0.0])
def test_a_command_that_is_valid_for_no_time_gives_no_heat(valid_for_s):
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 1.0, valid_for_s)
    clock.t_s += 5.0
    read(board, clock)
    assert board.truth()["energy_j"] == 0.0


def test_a_write_returns_what_the_converter_took():
    clock = HandClock()
    board = board_on(clock, dac_bits=8)
    assert write(board, clock, 0.5) == {"heater": 128 / 255}
    assert board.write({}, 2.5, clock.t_s) == {"heater": 128 / 255}


@pytest.mark.parametrize(("wished", "taken"), [(7.0, 1.0), (-1.0, 0.0), (math.nan, 0.0)])
def test_a_wild_drive_is_limited_and_what_is_no_number_is_off(wished, taken):
    clock = HandClock()
    assert write(board_on(clock), clock, wished) == {"heater": taken}


@pytest.mark.parametrize(
    "asked",
    [
        {"drive": None},
        {"drive": "1"},
        {"drive": True},
        {"drive": math.inf},
        {"drive": 10**400},
        {"valid_for_s": None},
        {"valid_for_s": math.inf},
    ],
)
def test_what_is_no_command_is_a_fault_and_the_heater_goes_off(asked):
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 0.5)
    with pytest.raises(FaultError, match="expected a finite number, got"):
        write(board, clock, **{"drive": 1.0, **asked})
    assert board.write({}, 2.5, clock.t_s) == {"heater": 0.0}


def test_an_output_that_is_not_there_is_refused_and_changes_nothing():
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 0.5)
    with pytest.raises(BoardConfigError, match="cooler"):
        board.write({"heater": 1.0, "cooler": 1.0}, 2.5, clock.t_s)
    assert board.write({}, 2.5, clock.t_s)["heater"] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("stage", "part"),
    [("linear", 0.25), ("square", 0.0625), ("phase-angle", 0.0908), ("burst", 0.26)],
)
def test_the_power_stage_decides_what_a_drive_gives(stage, part):
    heater_w = np.mean([watt for _, watt in run(30, 0.25, power_stage=stage)[1:]])
    assert heater_w / 1500.0 == pytest.approx(part, rel=0.05)


def test_a_dropout_leaves_the_input_out_and_is_reported():
    clock = HandClock()
    board = board_on(clock)
    board.disturb("dropout", 5.0)
    clock.t_s += 1.0
    assert board.read(clock.t_s) == {}
    assert board.health().status == "degraded"
    clock.t_s += 5.0
    assert read(board, clock).quality is Quality.GOOD
    assert board.health().status == "ok"


@pytest.mark.parametrize(("name", "quality"), [("open", Quality.OPEN), ("short", Quality.SHORT)])
def test_a_fault_of_the_wire_is_seen_on_the_counts(name, quality):
    clock = HandClock()
    board = board_on(clock)
    board.disturb(name, 5.0)
    clock.t_s += 1.0
    assert read(board, clock).quality is quality


def test_a_spike_spoils_one_sample():
    clock = HandClock()
    board = board_on(clock)
    board.disturb("spike", 50.0)
    spoilt, sound = read(board, clock), read(board, clock)
    assert spoilt.temperature_c == pytest.approx(75.0, abs=0.5)
    assert sound.temperature_c == pytest.approx(25.0, abs=0.5)


def test_cold_water_is_told_and_felt():
    clock = HandClock()
    board = board_on(clock, initial_c=37.5)
    assert board.disturb("cold-water", 1.0) == "1 l of 10 degC water poured in"
    assert board.truth()["true_temperature_c"] == pytest.approx(37.5 - 27.5 / 9.0, abs=1e-6)


def test_a_disturbance_that_cannot_be_is_refused():
    board = board_on(HandClock())
    with pytest.raises(Refused, match="earthquake"):
        board.disturb("earthquake")
    with pytest.raises(Refused, match="amount of sag"):
        board.disturb("sag", 3.0)


def test_a_board_that_is_not_open_neither_reads_nor_writes():
    clock = HandClock()
    board = SimulatedBoard(SimulatedSettings(), None, clock)
    assert board.health().status == "down"
    with pytest.raises(LinkError, match="opened"):
        board.read(clock.t_s)
    with pytest.raises(LinkError, match="opened"):
        write(board, clock, 1.0)


def test_closing_switches_off_and_may_be_done_twice():
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 1.0, valid_for_s=60.0)
    board.close()
    board.close()
    clock.t_s += 10.0
    board.open(clock.t_s)
    read(board, clock)
    assert board.truth()["energy_j"] == 0.0


def test_opening_again_switches_off():
    clock = HandClock()
    board = board_on(clock)
    write(board, clock, 1.0)
    board.open(clock.t_s)
    clock.t_s += 2.0
    read(board, clock)
    assert board.truth()["energy_j"] == 0.0


def spread_k(**settings: object) -> float:
    clock = HandClock()
    board = board_on(clock, bits=16, ice_kg=0.0, ambient_c=25.0, **settings)
    errors_k = []
    for _ in range(300):
        clock.t_s += 1.0
        errors_k.append(read(board, clock).temperature_c - board.truth()["sensor_c"])
    return float(np.std(errors_k))


def test_single_conversions_see_the_pickup_that_a_burst_averages_out():
    assert spread_k(conversions=1, noise_mv=0.0) > 0.1
    assert spread_k(conversions=32, noise_mv=0.0) < 0.005


def test_a_burst_covers_whole_periods_of_60_hertz_too():
    assert spread_k(mains_hz=60.0, noise_mv=0.0, pickup_mv=30.0) < 0.02


def test_noise_is_as_strong_as_it_was_set():
    assert spread_k(conversions=1, noise_mv=5.0, pickup_mv=0.0) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("lag", ["element_lag_s", "transport_s", "sensor_lag_s"])
def test_a_longer_lag_anywhere_makes_the_sensor_rise_later(lag):
    risen_k = []
    for lag_s in (3.0, 25.0):
        clock = HandClock()
        board = board_on(clock, **{lag: lag_s})
        for _ in range(60):
            write(board, clock, 1.0)
            clock.t_s += 1.0
        read(board, clock)
        risen_k.append(board.truth()["sensor_c"])
    assert risen_k[1] < risen_k[0] - 0.3


def test_the_water_cools_while_the_board_is_closed():
    clock = HandClock()
    board = board_on(clock, initial_c=60.0)
    board.close()
    clock.t_s += 600.0
    board.open(clock.t_s)
    assert board.truth()["true_temperature_c"] < 55.0


def test_a_clock_that_does_not_move_leaves_the_tank_as_it_is():
    clock = HandClock()
    board = board_on(clock)
    before = board.truth()
    read(board, clock)
    write(board, clock, 1.0)
    assert board.truth() == before


def test_tolerances_make_another_tank_of_every_seed():
    cooled = set()
    for seed in (1, 2):
        clock = HandClock()
        board = board_on(clock, tolerances=0.1, seed=seed, initial_c=60.0)
        clock.t_s += 600.0
        read(board, clock)
        cooled.add(round(board.truth()["true_temperature_c"], 1))
    assert len(cooled) == 2


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("volume_l", 0.1),
        ("heater_w", 1e5),
        ("bits", 2),
        ("power_stage", "steam"),
        ("colour", "red"),
        ("ambient_c", math.nan),
        ("tolerances", 1.0),
        ("kind", "null"),
    ],
)
def test_a_wrong_setting_is_refused_by_name(key, value):
    with pytest.raises(ValidationError, match=key):
        SimulatedSettings(**{key: value})


def test_settings_that_make_no_tank_together_are_refused_before_anything_is_on():
    beyond = SimulatedSettings(element_lag_s=120.0, tolerances=0.3, seed=SEED_OF_A_SLOW_ELEMENT)
    with pytest.raises(BoardConfigError, match=r"lag_s must lie in \[2, 120\]"):
        SimulatedBoard(beyond, None, HandClock())


def test_every_setting_says_what_it_is_and_knows_its_bounds():
    for name, entry in SimulatedSettings.model_fields.items():
        if name != "kind":
            assert entry.description, name
            assert entry.metadata or entry.annotation is bool or name == "power_stage", name


def test_a_cooler_is_an_output_of_its_own_and_only_where_there_is_one():
    clock = HandClock()
    board = board_on(clock, cooler_w=300.0)
    taken = board.write({"heater": 0.0, "cooler": 0.5}, 2.5, clock.t_s + 0.5)
    assert taken == {"heater": 0.0, "cooler": pytest.approx(0.5, abs=1e-3)}
    clock.t_s += 2.0
    board.read(clock.t_s)
    assert board.truth()["cooled_w"] > 0.0
    with pytest.raises(BoardConfigError, match="'heater', got 'cooler'"):
        board_on(clock).write({"cooler": 0.5}, 2.5, clock.t_s + 0.5)


def test_the_dead_man_cuts_the_cooler_as_it_cuts_the_heater():
    clock = HandClock()
    board = board_on(clock, cooler_w=300.0, cooler_lag_s=2.0)
    board.write({"cooler": 1.0}, 2.5, clock.t_s + 0.5)
    clock.t_s += 30.0
    board.read(clock.t_s)
    assert board.truth()["cooled_w"] < 0.1
    assert board.health().counters["dead_man"] == 1


def test_a_write_with_one_bad_drive_leaves_nothing_on():
    clock = HandClock()
    board = board_on(clock, cooler_w=300.0)
    board.write({"heater": 0.5}, 2.5, clock.t_s + 0.5)
    with pytest.raises(FaultError):
        board.write({"heater": 0.5, "cooler": math.inf}, 2.5, clock.t_s + 0.5)
    assert board.write({}, 2.5, clock.t_s + 0.5) == {"heater": 0.0, "cooler": 0.0}


def test_the_heater_may_have_a_sensor_and_it_changes_nothing_else():
    clock, plain = HandClock(), HandClock()
    board, other = board_on(clock, element_sensor=True), board_on(plain)
    for _ in range(30):
        clock.t_s, plain.t_s = clock.t_s + 1.0, plain.t_s + 1.0
        seen, alone = board.read(clock.t_s), other.read(plain.t_s)
        assert seen["temperature"] == alone["temperature"]
        write(board, clock, 0.5)
        write(other, plain, 0.5)
    shown_c = LM335_AT_5_V.measure(seen["element"], clock.t_s).temperature_c
    assert set(alone) == {"temperature"}
    assert shown_c == pytest.approx(board.truth()["element_c"], abs=0.5)
    assert shown_c > board.truth()["true_temperature_c"] + 10.0
