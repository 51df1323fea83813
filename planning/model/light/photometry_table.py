"""What a rig file says of light, `[photometry]`; without it none is counted."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from planning.model.table_types import Positive, SourcedTable

_Albedo = Annotated[float, Field(gt=0.0, le=1.0)]


class SensorTable(SourcedTable):
    """A sensor by its EMVA 1288 figures, over white light."""

    description: str = ""
    quantum_efficiency: Annotated[float, Field(gt=0.0, le=1.0)]
    full_well_e: Positive
    read_noise_e: Annotated[float, Field(ge=0.0)]


class PhotometryTable(SensorTable):
    """Light of the projector, the surface and the room; the sensor that sees it.

    `sensor`, a preset that the rest is laid over, has been resolved.
    """

    lumens: Positive
    contrast: Annotated[float, Field(gt=1.0)] = 500.0
    albedo: _Albedo | Annotated[list[_Albedo], Field(min_length=2, max_length=2)]
    room_lux: Annotated[float, Field(ge=0.0)] = 0.0
    lumens_per_watt: Annotated[float, Field(gt=0.0, le=683.0)] = 300.0
    transmission: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    gain_db: Annotated[float, Field(ge=0.0, le=48.0)] = 0.0
    bits: Annotated[int, Field(ge=8, le=16)] = 8
    min_contrast: Annotated[float, Field(ge=10.0, le=200.0)] = 15.0
    max_exposure_ms: Annotated[float, Field(gt=0.0, le=1e6)] | None = None

    @property
    def albedos(self) -> tuple[float, float]:
        """The least and the largest."""
        if isinstance(self.albedo, list):
            return self.albedo[0], self.albedo[1]
        return self.albedo, self.albedo

    @model_validator(mode="after")
    def _check_albedo(self) -> Self:
        low, high = self.albedos
        if low > high:
            raise ValueError(f"albedo = {self.albedo} must rise: darkest first")
        return self
