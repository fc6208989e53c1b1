"""One look at the store for all event streams of a process."""

import asyncio
from types import SimpleNamespace

from sqlalchemy.exc import OperationalError

from service.api.middleware import event_feed as feeds
from service.api.middleware.event_feed import Feed, wait


class Events(Feed):
    """A feed of made-up events that counts how often it asks for them."""

    def __init__(self, *ids):
        super().__init__(None)
        self.ids, self.asked, self.fails = list(ids), 0, False

    async def newest(self):
        return max(self.ids, default=0)

    async def after(self, seen):
        self.asked += 1
        if self.fails:
            raise OperationalError("SELECT", None, Exception("gone"))
        return [SimpleNamespace(id=each) for each in self.ids if each > seen]


def ids(records):
    return None if records is None else [record.id for record in records]


def run(events, play, monkeypatch):
    async def main():
        monkeypatch.setattr(feeds, "POLL_S", 0.01)
        await asyncio.wait_for(play(events), 20)

    asyncio.run(main())


async def soon(what):
    while not what():
        await asyncio.sleep(0.005)


def test_all_who_follow_are_told_by_one_look(monkeypatch):
    events = Events(1, 2)

    async def play(feed):
        for _ in range(50):
            await feed.join()
        await soon(lambda: feed.kept(2) == [])
        assert feed.kept(1) is None  # before it began: the store knows
        asked = events.asked
        news = feed.news
        events.ids += [3, 4]
        await asyncio.wait_for(news.wait(), 5)
        assert ids(feed.kept(2)) == [3, 4]
        assert ids(feed.kept(3)) == [4]
        assert events.asked - asked < 50
        for _ in range(50):
            feed.leave()
        asked = events.asked
        await asyncio.sleep(0.1)
        assert events.asked == asked  # nobody follows, and nothing is looked for

    run(events, play, monkeypatch)


def test_of_much_the_newest_is_kept(monkeypatch):
    events = Events()
    monkeypatch.setattr(feeds, "_KEPT", 3)

    async def play(feed):
        await feed.join()
        await soon(lambda: feed.kept(0) == [])
        events.ids += [1, 2, 3, 4, 5]
        await soon(lambda: feed.kept(5) == [] and feed.kept(4))
        assert feed.kept(1) is None
        assert ids(feed.kept(2)) == [3, 4, 5]
        feed.leave()

    run(events, play, monkeypatch)


def test_a_store_that_is_gone_for_a_while_ends_nothing(monkeypatch):
    events = Events(1)

    async def play(feed):
        await feed.join()
        await soon(lambda: feed.kept(1) == [])
        events.fails = True
        await wait(feed.news)
        events.ids.append(2)
        events.fails = False
        await soon(lambda: feed.kept(1))
        assert ids(feed.kept(1)) == [2]
        feed.leave()

    run(events, play, monkeypatch)
