"""What the tank is made of: frozen, in SI, each number with its source.

The defaults are the reference rig, 8 l of water in an aquarium that stands in ice (O21, section
"Computer-assisted temperature control"). Where O21 says nothing the value follows from the
geometry and common heat transfer figures, and is then checked by the figures of the whole rig
in `tests/unit/plant/test_reference_rig.py`. The equations stand in `docs/tank.md`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from thermoctl.ranges import require

WATER_J_PER_KG_K = 4181.0
"""Specific heat of water at 30 to 40 degC (within 0.3 % from 5 to 90 degC)."""
FUSION_J_PER_KG = 333_550.0
"""Latent heat of melting ice at 0 degC."""
WATER_KG_PER_L = 0.995
"""Density at 30 degC; within 0.5 % from 0 to 40 degC."""

REFERENCE_L = 8.0
REFERENCE_W = 1500.0


@dataclass(frozen=True, slots=True)
class Vessel:
    """Water, glass and what drains heat; by default 0.25 x 0.20 x 0.16 m.

    Parameters
    ----------
    volume_l : float
        Water at the start, 0.5 to 200 l.
    surface_m2 : float
        Open water, which is the base as well.
    side_m2 : float
        Wetted glass of the four sides at the nominal level.
    still_share : float
        Part of the water in the zone behind heater and sensor, 0.05 to 0.5.
    still_wall_share : float
        Part of the glass that this zone faces, 0.05 to 0.6: the corners and most of the base.
    exchange_w_per_k : float
        Heat exchange between the zones with the stirrer on: 0.19 kg/s, a turnover of 8 s.
    still_exchange_w_per_k : float
        The same by natural convection: leaves the still zone 1.5 to 2 K colder, 0.35 K of the mean.
    inner_w_per_m2_k : float
        Stirred water to glass; forced convection in water is 300 to 1,000.
    still_inner_w_per_m2_k : float
        The same with the stirrer off; natural convection in water is 80 to 200.
    glass_m, glass_w_per_m_k, glass_j_per_m3_k : float
        Soda-lime glass of a small aquarium: 4 mm, 1.0 W/(m K), 2500 kg/m3 x 840 J/(kg K).
    bath_film_w_per_m2_k : float
        Glass to slush at rest, set so that holding 37.5 degC takes 280 to 300 W.
    room_film_w_per_m2_k : float
        Glass to still air where there is no bath: convection 4, radiation 5.
    brim_ratio : float
        The tank overflows beyond this times its nominal volume.
    """

    volume_l: float = REFERENCE_L
    surface_m2: float = 0.050
    side_m2: float = 0.144
    still_share: float = 0.20
    still_wall_share: float = 0.25
    exchange_w_per_k: float = 800.0
    still_exchange_w_per_k: float = 30.0
    inner_w_per_m2_k: float = 400.0
    still_inner_w_per_m2_k: float = 120.0
    glass_m: float = 0.004
    glass_w_per_m_k: float = 1.0
    glass_j_per_m3_k: float = 2500.0 * 840.0
    bath_film_w_per_m2_k: float = 46.0
    room_film_w_per_m2_k: float = 9.0
    brim_ratio: float = 1.5

    def __post_init__(self) -> None:
        require("volume_l", self.volume_l, 0.5, 200.0)
        require("surface_m2", self.surface_m2, 1e-4, 10.0)
        require("side_m2", self.side_m2, 1e-4, 20.0)
        require("still_share", self.still_share, 0.05, 0.5)
        require("still_wall_share", self.still_wall_share, 0.05, 0.6)
        require("exchange_w_per_k", self.exchange_w_per_k, 1.0, 1e5)
        require("still_exchange_w_per_k", self.still_exchange_w_per_k, 0.1, 1e5)
        require("inner_w_per_m2_k", self.inner_w_per_m2_k, 10.0, 5000.0)
        require("still_inner_w_per_m2_k", self.still_inner_w_per_m2_k, 10.0, 5000.0)
        require("glass_m", self.glass_m, 5e-4, 0.05)
        require("glass_w_per_m_k", self.glass_w_per_m_k, 0.01, 400.0)
        require("glass_j_per_m3_k", self.glass_j_per_m3_k, 5e5, 5e6)
        require("bath_film_w_per_m2_k", self.bath_film_w_per_m2_k, 0.0, 1000.0)
        require("room_film_w_per_m2_k", self.room_film_w_per_m2_k, 0.0, 1000.0)
        require("brim_ratio", self.brim_ratio, 1.0, 5.0)

    @property
    def water_kg(self) -> float:
        """Mass of the water at the nominal level."""
        return self.volume_l * WATER_KG_PER_L

    @property
    def glass_area_m2(self) -> float:
        """Wetted glass at the nominal level, base included."""
        return self.surface_m2 + self.side_m2


@dataclass(frozen=True, slots=True)
class Element:
    """The heater: an immersed tube with a capacity of its own.

    Parameters
    ----------
    rated_w : float
        Power at nominal mains voltage, 50 to 5,000 W.
    above_water_k : float
        How far above the water it settles at full power: 75 K, 5 to 10 W/cm2 in stirred water.
    lag_s : float
        Its time constant in stirred water; 10 to 30 s are usual for tubular elements.
    still_factor : float
        Heat transfer without stirrer, as a part of that with it.
    """

    rated_w: float = REFERENCE_W
    above_water_k: float = 75.0
    lag_s: float = 13.5
    still_factor: float = 0.7

    def __post_init__(self) -> None:
        require("rated_w", self.rated_w, 50.0, 5000.0)
        require("above_water_k", self.above_water_k, 1.0, 500.0)
        require("lag_s", self.lag_s, 2.0, 120.0)
        require("still_factor", self.still_factor, 0.1, 1.0)

    @property
    def to_water_w_per_k(self) -> float:
        """Conductance to stirred water."""
        return self.rated_w / self.above_water_k

    @property
    def capacity_j_per_k(self) -> float:
        """Heat capacity: 270 J/K for the reference, 0.6 kg of steel and magnesia."""
        return self.lag_s * self.to_water_w_per_k


@dataclass(frozen=True, slots=True)
class Cooler:
    """A coil in the stirred water that takes heat out; the rig has none.

    Parameters
    ----------
    rated_w : float
        Heat it takes out at full drive, 0 to 5,000 W; 0: there is none.
    lag_s : float
        How long it takes to follow its drive, 2 to 120 s.
    """

    rated_w: float = 0.0
    lag_s: float = 20.0

    def __post_init__(self) -> None:
        require("rated_w", self.rated_w, 0.0, 5000.0)
        require("lag_s", self.lag_s, 2.0, 120.0)


@dataclass(frozen=True, slots=True)
class Bath:
    """The container of ice the tank stands in.

    Parameters
    ----------
    ice_kg : float
        Ice at the start; 0 together with ``water_kg`` 0 means that there is no bath.
    water_kg : float
        Melt water at the start; at least a quarter of the ice, or slush would be air.
    from_room_w_per_k : float
        Room to bath through the container: 0.25 m2 at 8 W/(m2 K).
    melting_w_per_kg_k : float
        Ice to bath water at rest, per kg of ice left: 30 mm cubes have 0.2 m2/kg, at 300 W/(m2 K).
    """

    ice_kg: float = 12.0
    water_kg: float = 5.0
    from_room_w_per_k: float = 2.0
    melting_w_per_kg_k: float = 60.0

    def __post_init__(self) -> None:
        require("ice_kg", self.ice_kg, 0.0, 500.0)
        require("water_kg", self.water_kg, 0.0, 500.0)
        require("from_room_w_per_k", self.from_room_w_per_k, 0.0, 100.0)
        require("melting_w_per_kg_k", self.melting_w_per_kg_k, 1.0, 200.0)
        if self.water_kg < 0.25 * self.ice_kg:
            raise ValueError(
                f"water_kg must be at least a quarter of ice_kg {self.ice_kg:g}, "
                f"got {self.water_kg!r}"
            )

    @property
    def exists(self) -> bool:
        """Whether there is anything in the bath."""
        return self.water_kg > 0.0

    @classmethod
    def holding(cls, ice_kg: float, size: float = 1.0) -> Bath:
        """Return a bath of `ice_kg`; its area is `size` times the reference's."""
        if ice_kg == 0.0:
            return cls(ice_kg=0.0, water_kg=0.0)
        default = cls()
        return cls(
            ice_kg=ice_kg,
            water_kg=default.water_kg / default.ice_kg * ice_kg,
            from_room_w_per_k=default.from_room_w_per_k * size,
        )


@dataclass(frozen=True, slots=True)
class Room:
    """The air around.

    Parameters
    ----------
    temperature_c : float
        0 to 50 degC.
    humidity : float
        Relative humidity, 0 to 1.
    convection_w_per_m2_k : float
        Water surface to air; 5 to 10 without wind. Evaporation follows from it (Lewis).
    radiation_w_per_m2_k : float
        Linearised about 30 degC with an emissivity of 0.9.
    """

    temperature_c: float = 22.0
    humidity: float = 0.5
    convection_w_per_m2_k: float = 7.0
    radiation_w_per_m2_k: float = 5.5

    def __post_init__(self) -> None:
        require("temperature_c", self.temperature_c, 0.0, 50.0)
        require("humidity", self.humidity, 0.0, 1.0)
        require("convection_w_per_m2_k", self.convection_w_per_m2_k, 0.0, 200.0)
        require("radiation_w_per_m2_k", self.radiation_w_per_m2_k, 0.0, 20.0)


@dataclass(frozen=True, slots=True)
class Probe:
    """Where and how the water is felt.

    Parameters
    ----------
    transport_s : float
        Time the water takes from the heater to the sensor, 0 to 30 s; 1 to 4 s on the rig.
    still_transport_factor : float
        How many times longer it takes without stirrer.
    lag_s : float
        First-order lag of the sheath, 0.5 to 120 s; 4 to 10 s on the rig.
    turbulence_k : float
        Standard deviation of the local temperature about the mean of its zone.
    turbulence_s : float
        Its correlation time.
    gain_error : float
        Relative error of the LM335, 0 when calibrated; 1 % (3 K) is the grade's limit.
    """

    transport_s: float = 2.0
    still_transport_factor: float = 2.5
    lag_s: float = 6.0
    turbulence_k: float = 0.03
    turbulence_s: float = 2.0
    gain_error: float = 0.0

    def __post_init__(self) -> None:
        require("transport_s", self.transport_s, 0.0, 30.0)
        require("still_transport_factor", self.still_transport_factor, 1.0, 10.0)
        require("lag_s", self.lag_s, 0.5, 120.0)
        require("turbulence_k", self.turbulence_k, 0.0, 1.0)
        require("turbulence_s", self.turbulence_s, 0.5, 60.0)
        require("gain_error", self.gain_error, -0.05, 0.05)


@dataclass(frozen=True, slots=True)
class Supply:
    """The mains that feed the heater, and how restless they and the ice are.

    Parameters
    ----------
    voltage_spread : float
        Standard deviation of the voltage as a fraction; EN 50160 allows 10 %, a house has 1 %.
    voltage_s : float
        Correlation time of the voltage.
    loss_spread : float
        Standard deviation of the heat transfer to the bath as a fraction: ice settles and turns.
    loss_s : float
        Correlation time of that.
    """

    voltage_spread: float = 0.01
    voltage_s: float = 60.0
    loss_spread: float = 0.03
    loss_s: float = 120.0

    def __post_init__(self) -> None:
        require("voltage_spread", self.voltage_spread, 0.0, 0.1)
        require("voltage_s", self.voltage_s, 1.0, 1e4)
        require("loss_spread", self.loss_spread, 0.0, 0.2)
        require("loss_s", self.loss_s, 1.0, 1e4)


@dataclass(frozen=True, slots=True)
class TankParameters:
    """Everything the tank is made of; the default is the reference rig.

    Parameters
    ----------
    second : Probe, optional
        Another probe in the same water; the rig has none.
    initial_c : float
        Water, glass and heater at the start, 1 to 95 degC.
    pour_c : float
        Temperature of water that is poured in as a disturbance.

    Raises
    ------
    ValueError
        When any number lies outside its range; the message names it.
    """

    vessel: Vessel = field(default_factory=Vessel)
    element: Element = field(default_factory=Element)
    bath: Bath = field(default_factory=Bath)
    room: Room = field(default_factory=Room)
    probe: Probe = field(default_factory=Probe)
    supply: Supply = field(default_factory=Supply)
    cooler: Cooler = field(default_factory=Cooler)
    initial_c: float = 25.0
    pour_c: float = 10.0
    second: Probe | None = None

    def __post_init__(self) -> None:
        require("initial_c", self.initial_c, 1.0, 95.0)
        require("pour_c", self.pour_c, 0.0, 95.0)

    @classmethod
    def scaled(
        cls,
        volume_l: float = REFERENCE_L,
        heater_w: float = REFERENCE_W,
        *,
        ambient_c: float = 22.0,
        initial_c: float = 25.0,
        ice_kg: float | None = None,
    ) -> TankParameters:
        """Return a tank of the rig's shape and another size.

        Areas and stirring grow with volume^(2/3), the transport with volume^(1/3), the element
        with its power.

        Parameters
        ----------
        volume_l, heater_w : float
            0.5 to 200 l, 50 to 5,000 W.
        ambient_c, initial_c : float
            Temperatures of the room and at the start.
        ice_kg : float or None
            Ice in the bath, 0 for no bath; None for as much per area as the rig has.

        Raises
        ------
        ValueError
            When an argument lies outside its range; the message names it.
        """
        require("volume_l", volume_l, 0.5, 200.0)
        require("heater_w", heater_w, 50.0, 5000.0)
        require("ambient_c", ambient_c, 0.0, 50.0)
        length = (volume_l / REFERENCE_L) ** (1.0 / 3.0)
        area = length**2
        rig = Vessel()
        vessel = replace(
            rig,
            volume_l=volume_l,
            surface_m2=rig.surface_m2 * area,
            side_m2=rig.side_m2 * area,
            exchange_w_per_k=rig.exchange_w_per_k * area,
            still_exchange_w_per_k=rig.still_exchange_w_per_k * area,
        )
        return cls(
            vessel=vessel,
            element=Element(rated_w=heater_w),
            bath=Bath.holding(Bath().ice_kg * area if ice_kg is None else ice_kg, area),
            room=Room(temperature_c=ambient_c),
            probe=Probe(transport_s=Probe().transport_s * length),
            initial_c=initial_c,
        )
