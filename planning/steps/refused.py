"""What can't be asked together, told before any work."""

from planning.report.partial_plan import PlanRequest

from .asked.family_request import check_family
from .cameras_alone.refusals import check_alone
from .joint.joining import check_joint
from .stations.carried import check_carried
from .surviving import check_survival


def check_request(request: PlanRequest) -> None:
    """Refuse what can't be planned together.

    Raises:
        InputError: It names both, and what to do.
    """
    if request.family is not None:
        check_family(request)
    check_carried(request)
    check_survival(request)
    if request.wishes.joint:
        check_joint(request)
    if request.wishes.pattern == "none":
        check_alone(request)
