"""Oil of a film, and of the film between a pin and its eye."""

from typing import Self

from pydantic import Field, model_validator

from .dimensions import (
    Damping,
    Density,
    HeatConductance,
    KinematicViscosity,
    Length,
    Pressure,
    SpecificHeat,
    Temperature,
    Viscosity,
    VolumeFlow,
)
from .limits import DAMPING_MOST, LONGEST, PRESSURE_MOST
from .oil_viscosity import walther_viscosity
from .part import Part

_VISCOSITY_LEAST, _VISCOSITY_MOST = 1e-6, 1e4  # Pa s, from air to pitch
_CONDUCTANCE_MOST = 1e4  # W/K, a water-cooled housing has hundreds
_FLOW_MOST = 1.0  # m^3/s, a turbine's bearing takes a hundredth
_FORTY, _HUNDRED = 313.15, 373.15  # K, temperatures of the viscosities in data sheets


class Oil(Part):
    """The oil in the film, at its operating temperature.

    Give its viscosity, or its temperature with the density and the two kinematic viscosities of
    its data sheet: Walther's law (ASTM D341) then gives the viscosity.
    """

    viscosity: Viscosity | None = Field(
        default=None,
        ge=_VISCOSITY_LEAST,
        le=_VISCOSITY_MOST,
        description="dynamic viscosity in the film",
    )
    temperature: Temperature | None = Field(
        default=None,
        ge=200,
        le=600,
        description="absolute temperature: 50 degrees Celsius are 323.15 K",
    )
    viscosity_40: KinematicViscosity | None = Field(
        default=None, ge=2e-6, le=1e-1, description="kinematic viscosity at 40 degrees Celsius"
    )
    viscosity_100: KinematicViscosity | None = Field(
        default=None, ge=2e-6, le=1e-1, description="kinematic viscosity at 100 degrees Celsius"
    )
    density: Density | None = Field(
        default=None, ge=500, le=2000, description="density in the film"
    )

    @model_validator(mode="after")
    def _one_way_to_know_it(self) -> Self:
        names = ("temperature", "viscosity_40", "viscosity_100", "density")
        given = [name for name in names if getattr(self, name) is not None]
        missing = [name for name in names if name not in given]
        if self.viscosity is not None and given:
            raise ValueError(
                f"viscosity and {', '.join(given)} given, must be one or the other; remove one"
            )
        if self.viscosity is None and missing:
            raise ValueError(
                f"viscosity is missing; add it, or {', '.join(missing)} for Walther's law"
            )
        if self.viscosity is None:
            try:
                found = self.dynamic_viscosity
            except ValueError as error:
                raise ValueError(f"Walther's law: {error}") from None
            if not _VISCOSITY_LEAST <= found <= _VISCOSITY_MOST:
                raise ValueError(
                    f"temperature = {self.temperature:g} K gives a viscosity of {found:.3g} Pa s, "
                    f"must be within {_VISCOSITY_LEAST:g} and {_VISCOSITY_MOST:g} Pa s"
                )
        return self

    @property
    def dynamic_viscosity(self) -> float:
        """Dynamic viscosity in the film [Pa s], as given or by Walther's law."""
        if self.viscosity is not None:
            return self.viscosity
        assert self.temperature is not None  # the validator ensures that all four are given
        return self.viscosity_at(self.temperature)

    def warmed(self, kelvin: float) -> float:
        """Dynamic viscosity in a film warmer by a difference [Pa s].

        Parameters
        ----------
        kelvin : float
            Temperature difference [K]; non-zero only if the oil's temperature is given.

        Examples
        --------
        >>> oil = Oil(temperature=313.15, viscosity_40=1e-4, viscosity_100=1.14e-5, density=875.0)
        >>> round(oil.warmed(0.0), 4), round(oil.warmed(10.0), 4)
        (0.0875, 0.0538)
        """
        if kelvin == 0:
            return self.dynamic_viscosity
        assert self.temperature is not None  # ensured by the scene's check
        return self.viscosity_at(self.temperature + kelvin)

    def thickened(self, ratio: float) -> Self:
        """Oil with its viscosity multiplied by a ratio at every temperature.

        Parameters
        ----------
        ratio : float

        Examples
        --------
        >>> Oil(viscosity=0.02).thickened(1.5).viscosity
        0.03
        """
        if self.viscosity is not None:
            return self.model_copy(update={"viscosity": self.viscosity * ratio})
        assert self.density is not None
        # Walther's law is for the kinematic viscosity: scaling the density is exact for any ratio
        return self.model_copy(update={"density": self.density * ratio})

    def viscosity_at(self, temperature: float) -> float:
        """Dynamic viscosity at a temperature [Pa s], by Walther's law.

        Parameters
        ----------
        temperature : float
            Absolute temperature [K].

        Raises
        ------
        ValueError
            The temperature is outside the range of the law.
        """
        assert self.viscosity_40 is not None
        assert self.viscosity_100 is not None
        assert self.density is not None
        points = ((_FORTY, self.viscosity_40), (_HUNDRED, self.viscosity_100))
        return walther_viscosity(temperature, points, density=self.density)


class JointOil(Oil):
    """Oil between a pin and its eye, and the rough surfaces it separates."""

    length: Length = Field(gt=0, le=LONGEST, description="length of the eye along the pin")
    groove_width: Length = Field(
        default=0.0,
        ge=0,
        le=LONGEST,
        description="width of a circumferential groove in the middle, leaving two lands; 0: none",
    )
    filled_gap: Length | None = Field(
        default=None,
        gt=0,
        le=LONGEST,
        description="thickest gap that holds oil: splash or grease; none: flooded",
    )
    wall_damping: Damping | None = Field(
        default=None,
        ge=0,
        le=DAMPING_MOST,
        description="damping of the parts behind the film; none: a tenth of sqrt(stiffness x mass)",
    )
    conductance: HeatConductance | None = Field(
        default=None,
        gt=0,
        le=_CONDUCTANCE_MOST,
        description="heat conductance from the film to surroundings at `temperature`; with it, or "
        "with a flow, friction heats the film and thins it",
    )
    flow: VolumeFlow | None = Field(
        default=None,
        gt=0,
        le=_FLOW_MOST,
        description="flow of oil through the film, fed at `temperature`; it carries heat away",
    )
    specific_heat: SpecificHeat = Field(
        default=2000.0, ge=500, le=10_000, description="specific heat of that flow"
    )
    roughness: Length | None = Field(
        default=None,
        gt=0,
        le=1e-4,
        description="combined roughness of both surfaces (root of summed squares), rung mixed",
    )
    asperity_stiffness: Pressure = Field(
        default=160e6,
        gt=0,
        le=PRESSURE_MOST,
        description="pressure factor of Greenwood and Tripp, about 0.003 of the contact modulus",
    )

    @property
    def carried_per_kelvin(self) -> float:
        """Heat carried away per kelvin above `temperature` [W/K]; 0 without a heat balance.

        By the flow, density x specific heat x flow, and by the metal.
        """
        flow = (self.flow or 0.0) * (self.density or 0.0) * self.specific_heat
        return flow + (self.conductance or 0.0)

    @model_validator(mode="after")
    def _heat_is_known(self) -> Self:
        asked = [name for name in ("conductance", "flow") if getattr(self, name) is not None]
        if not asked:
            return self
        faults = []
        if self.viscosity is not None:
            faults.append(
                f"viscosity = {self.viscosity:g} Pa s with {' and '.join(asked)}: a film that "
                "heats up needs temperature, viscosity_40, viscosity_100, density instead"
            )
        if self.filled_gap is not None:
            faults.append(
                f"filled_gap = {self.filled_gap:g} m with {' and '.join(asked)}: the heat balance "
                "is of a flooded film; remove one"
            )
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @model_validator(mode="after")
    def _groove_leaves_lands(self) -> Self:
        if self.groove_width >= self.length:
            raise ValueError(
                f"groove_width = {self.groove_width:g} m must be < length = {self.length:g} m; "
                "it leaves two lands"
            )
        return self
