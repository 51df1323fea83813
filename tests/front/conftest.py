import pytest

from planning import load_rig


@pytest.fixture(scope="module")
def rig():
    few = {"n_candidate_projectors": 30, "n_candidate_cameras": 30}
    return load_rig().replace(placement=few)
