"""The pose that the service would serve, for studies: nothing that fails is done without."""

from models.pose import CameraSite, Observations, PoseFinding, SecondLook, estimate_pose


def served_pose(
    tracks: Observations, site: CameraSite, second_look: SecondLook | None = None
) -> PoseFinding:
    """The finding of tracks at a learned site, with the search for a change.

    Raises:
        Exception: what a part failed with that the service would have done without: in a study it
            is a fault.
    """
    found = estimate_pose(tracks, site, second_look)
    if found.failures:
        raise found.failures[0].error
    return found
