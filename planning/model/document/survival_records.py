"""What a plan says of the loss of each device, and of measuring several times."""

from .part import Part


class LossRecord(Part):
    """What is left of the target when a device is lost; areas in [m²].

    Attributes:
        lost: Id of the device; None: all are there.
        lit_m2: Lit by the projectors that are left.
        reachable_by_projectors_m2: As in `coverage`: a loss doesn't change it.
        measured_m2: Measured by as many pairs as are asked for.
        reachable_by_cameras_m2: Of what is lit then, what reference cameras and those
            of the plan could measure by as many pairs with the projectors left.
        floors_missed: Regions that fall below their floor.
    """

    lost: str | None
    lit_m2: float
    reachable_by_projectors_m2: float
    measured_m2: float
    reachable_by_cameras_m2: float
    floors_missed: tuple[int, ...] = ()


class SurvivingCountRecord(Part):
    """What survival costs of a kind of device, and what is proved of it.

    Attributes:
        count: Devices of the plan.
        needed: So many are enough for the candidates' samples.
        without: As many do without survival, of the same candidates.
        lower_bound: Proven least number over the candidates.
        everywhere: The same over every pose of the workspace; None: not looked for.
    """

    count: int
    needed: int
    without: int
    lower_bound: int
    everywhere: int | None = None


class SurvivalRecord(Part):
    """What `requirements.survival` asks for, device by device.

    Attributes:
        samples: Fresh samples of the target behind the areas.
        losses: With all devices there, then without each that may be lost.
        projectors: What it costs; None where devices are evaluated as they stand.
        cameras: The same, given the projectors.
    """

    samples: int
    losses: tuple[LossRecord, ...]
    projectors: SurvivingCountRecord | None = None
    cameras: SurvivingCountRecord | None = None
