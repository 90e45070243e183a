"""The seam stage: cloud in, seams out, by the method the config names."""

from threadpoolctl import threadpool_limits

from weldsim.records import PointCloud, SeamFindings
from weldsim.seam.config import SeamConfig
from weldsim.seam.profile.find import find_seams_profile


def find_seams(cloud: PointCloud, config: SeamConfig) -> SeamFindings:
    """Seams of a cloud in B, best first; none, with reasons, where there is none.

    Args:
        cloud: in B, plannable (`weldsim.cloud.check_plannable`).
    """
    if config.method == "thesis":
        # Loaded here: the published method compiles native loops, which the default one does not need.
        from weldsim.seam.thesis.find import find_seams_thesis

        return find_seams_thesis(cloud, config.thesis)
    # Its matrices are a few hundred rows: threads of the BLAS library would spend their time waiting for each other.
    with threadpool_limits(1, user_api="blas"):
        return find_seams_profile(cloud, config.profile)
