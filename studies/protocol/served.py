"""The pose that the service would serve, for studies: nothing that fails is done without."""

from models.pose import CameraSite, Observations, PoseFinding, estimate_pose


def served_pose(tracks: Observations, site: CameraSite) -> PoseFinding:
    """The finding of tracks at a learned site, with the search for a change.

    Raises:
        Exception: what a part failed with that the service would have done without: in a study it
            is a fault.
    """
    found = estimate_pose(tracks, site)
    if found.failures:
        raise found.failures[0].error
    return found
