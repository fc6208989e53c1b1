"""The two halves of a bridge without a broker or a service, for one test at a time."""

from surefoot.bridge.door import Door
from surefoot.bridge.feeds import Topics
from surefoot.bridge.inward import Inward
from surefoot.bridge.posting import Posting
from surefoot.bridge.tally import Tally

TOPICS = Topics(prefix="surefoot", frigate="frigate", cameras={})


class Listing:
    """A service with some cameras, which counts how often it is asked for them."""

    def __init__(self, *cameras):
        self.cameras, self.asked = cameras, 0

    def items(self, path):
        assert path == "/cameras"
        self.asked += 1
        return iter([{"id": camera} for camera in self.cameras])


def inward(inbox, spool, **changes):
    """The half that reads messages; it admits every camera unless a test says otherwise."""
    given = {"topics": TOPICS, "tally": Tally(), "admits": lambda _: True} | changes
    return Inward(inbox=inbox, spool=spool, **given)


def posting_of(spool, service, **changes):
    """The half that posts tracks."""
    given = {"door": Door(Listing()), "tally": Tally()} | changes
    return Posting(spool=spool, service=service, **given)
