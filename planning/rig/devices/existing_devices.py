"""Existing devices in the world, and whether so many may stand."""

from collections.abc import Iterator, Mapping, Sequence

from planning.model.devices.bodies import Body, Existing
from planning.model.devices.device_poses import rounded_pose
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.requirements import Requirements, Workspace
from planning.rig.existing_tables import ExistingTable

from .models import Model, named


def build_existing(
    tables: Sequence[ExistingTable],
    workspace: Workspace,
    models: Mapping[str, Sequence[Model]],
) -> tuple[Existing, ...]:
    """Return the devices of `[[existing]]` in the world, as the plan will hold them.

    `models` are the rig's of each kind.

    Raises:
        RigError: If one is of a model that the rig doesn't have.
    """
    faults = [*_unknown(tables, models)]
    if faults:
        raise RigError("\n".join(faults))

    def placed(table: ExistingTable) -> Existing:
        model = named(models[table.kind], table.model)
        assert model is not None
        pose = rounded_pose(table.pose(workspace, model.device)).tolist()
        rows = tuple(tuple(row) for row in pose)
        body = Body.of(table.body) or model.body
        return Existing(table.name, table.kind, rows, body, model=model.name)

    return tuple(placed(table) for table in tables)


def _unknown(
    tables: Sequence[ExistingTable], models: Mapping[str, Sequence[Model]]
) -> Iterator[str]:
    """A sentence for each entry of a model that the rig doesn't have."""
    for table in tables:
        if named(models[table.kind], table.model) is None:
            names = [model.table.name for model in models[table.kind]]
            yield (
                f"existing {table.name!r}: model = {table.model!r} is none of the "
                f"rig's {table.kind}s; name one of {', '.join(map(repr, names))}"
            )


def check_existing(required: Requirements) -> None:
    """Refuse more existing devices than are allowed, and two where one can stand.

    Raises:
        InfeasibleLimitsError: It names the limit, both numbers and what to do.
    """
    for kind, most in (
        ("projector", required.max_projectors),
        ("camera", required.max_cameras),
    ):
        n = len(required.existing_of(kind))
        if most is not None and n > most:
            raise InfeasibleLimitsError(
                f"max_{kind}s = {most} is less than the {n} {kind}s of [[existing]], "
                f"or --fixed, which stay; raise --max-{kind}s or take one out"
            )
        places: dict[tuple[float, ...], str] = {}
        for device in required.existing_of(kind):
            place = tuple(row[3] for row in device.world_from_device[:3])
            if place in places:
                raise InfeasibleLimitsError(
                    f"existing {kind}s {places[place]!r} and {device.name!r} stand at "
                    f"the same place; take one out or correct it"
                )
            places[place] = device.name
        for model, count in required.stock_of(kind).items():
            taken = sum(d.model == model for d in required.existing_of(kind))
            if taken > count:
                raise InfeasibleLimitsError(
                    f"{taken} existing {kind}s are of {model!r}, of which count = "
                    f"{count} says there are no more; raise it or take one out"
                )
