"""Alerts in words: their kinds, what came of them, and what an Alertmanager shows of them."""

from collections.abc import Sequence

from service.enums import AlertKind, Outcome

KINDS = {
    AlertKind.DRIFT: "The camera moved",
    AlertKind.CLOCK: "The clock looks wrong",
    AlertKind.NO_DATA: "No people come",
    AlertKind.STALE: "Its estimate is not being made",
    AlertKind.TRACKER: "Another tracker posts",
}
OUTCOMES = {
    Outcome.PUT_BACK: "put back",
    Outcome.ACCEPTED: "new pose accepted",
    Outcome.FALSE_ALARM: "false alarm",
    Outcome.CLEARED: "ended by itself",
    Outcome.CAMERA_REMOVED: "camera removed",
}
# Notes on alerts that ended by themselves.
TRACKS_COME_AGAIN = "tracks come again"
ESTIMATED_AGAIN = "it is looked at again"
ONE_SOURCE_POSTS = "only one source posts"
# A test alert's description.
TEST_ENDS = "This is a test of surefoot; it ends by itself."


def source_change(name: str, last: str | None) -> str:
    """A change of the source that counts: "new instead of old"."""
    return f"{name} instead of {last}"


def fired_as(kind: AlertKind) -> str:
    """The note on an alert that ended since another kind tells the same."""
    return f"it is told as {kind} now"


def alert_summary(
    kind: str, camera_id: str | None, camera_ids: Sequence[str] | None, track_source: str | None
) -> str:
    """An alert in a line: "no data: camera north-1", "drift: 4 cameras of bytetrack"."""
    whose = f"camera {camera_id}"
    if camera_id is None and track_source:
        whose = f"{len(camera_ids or ())} cameras of {track_source}"
    return f"{kind.replace('_', ' ')}: {whose}"
