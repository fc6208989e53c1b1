"""What stays is looked through for garbage once, and not again and again."""

import subprocess
import sys

ASKED = """
import gc
from service.workers.processes.collector import settle_collector

gc.disable()
settle_collector()
kept = []

def after_a_collection(more):
    frozen = gc.get_freeze_count()
    kept.append([[] for _ in range(more)])
    gc.collect()
    return gc.get_freeze_count() - frozen

print(after_a_collection(1_000) > 0, *(after_a_collection(9_000) >= 9_000 for _ in range(11)))
first, second = [], []
first.append(second), second.append(first)
del first, second
print(gc.collect())
"""


def test_what_survives_is_frozen_ten_times_where_it_is_much():
    told = subprocess.run(
        [sys.executable, "-c", ASKED], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert told[0].split() == ["False", *["True"] * 10, "False"]
    assert told[1] == "2"  # garbage that comes later is still found


SOON = """
import gc
from service.workers.processes.collector import settle_collector

imported = [[] for _ in range(800_000)]
settle_collector()
before = gc.get_stats()[2]["collections"]
new = [[] for _ in range(500_000)]
print(gc.get_stats()[2]["collections"] - before)
"""


def test_what_was_imported_does_not_put_off_the_next_collection_until_much_is_new():
    told = subprocess.run([sys.executable, "-c", SOON], capture_output=True, text=True, check=True)
    assert int(told.stdout) > 0


IMPORTING = """
import gc
from service.workers.processes.collector import importing

class Failed(Exception): pass

before = gc.get_stats()
try:
    with importing():
        imported = [[] for _ in range(50_000)]
        print(gc.get_stats() == before)
        raise Failed
except Failed:
    print(gc.isenabled(), gc.get_freeze_count() > 50_000)
"""


def test_nothing_is_looked_at_while_it_is_imported_nor_afterwards():
    told = subprocess.run(
        [sys.executable, "-c", IMPORTING], capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == ["True"] * 3
