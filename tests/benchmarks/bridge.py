"""The bridge between a real mosquitto and a real service: `python -m tests.benchmarks.bridge`.

python -m tests.benchmarks.bridge people [--away-s 60]   900 people of recorded scenes by Frigate's
    messages, the bridge killed twice and the service away: exits with 1 unless each is stored once
python -m tests.benchmarks.bridge load [--cameras 200 --seconds 60]   a frame of five people a
    camera each 0.2 s: exits with 1 where the bridge takes more than half a core, or loses one
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from paho.mqtt.client import CallbackAPIVersion, Client, MQTTv5

from models.tracks.scenes import load_scene
from service.commands.migrate import migrate
from service.commands.replay import camera_body
from service.settings import Settings
from tests.conftest import CAMERA, SCENES
from tests.running import RunningService, free_port, wait_for
from tests.surefoot.bridge.stand import Client5, bridged, broker, frigate_event, paths_of

_PEOPLE, _HZ, _WALK_S, _AT_ONCE = 900, 5.0, 12.0, 5
_MOST_CPU = 0.5
_DAY_S = 86_400.0


@contextmanager
def running(folder: Path) -> Iterator[RunningService]:
    """A service without workers over an empty store."""
    settings = Settings(data_dir=folder / "data", port=free_port(), workers=0)
    (folder / "data").mkdir()
    migrate(settings)
    service = RunningService(settings, forked=False)
    service.start()
    try:
        yield service
    finally:
        service.stop()


def stored(service: RunningService) -> dict[str, int]:
    """How many tracks each camera has."""
    items = service.http.get("/cameras", params={"limit": 1000}).json()["items"]
    return {each["id"]: each["tracks"] for each in items}


def people(folder: Path, away_s: float) -> bool:
    """True if each of the people is stored once."""
    scenes = [load_scene(SCENES / name) for name in ("town_centre", "wildtrack_c1", "wildtrack_c3")]
    walks = [
        (scene.scene_id, f"{name}-{day}", path)
        for day in range(12)
        for scene in scenes
        for name, path in paths_of(scene, 1.7e9 + _DAY_S * day)
    ][:_PEOPLE]
    wanted = {scene.scene_id: sum(walk[0] == scene.scene_id for walk in walks) for scene in scenes}
    with running(folder) as service, broker(folder) as port:
        for scene in scenes:
            body = camera_body(scene.scene_id, scene.intrinsics, scene.true_pose)
            service.http.post("/cameras", json=body).raise_for_status()
        client = Client5(port)
        with bridged(folder, port, service.url) as bridge:
            gone_s = 0.0
            for at, (camera, name, path) in enumerate(walks):
                if at in (225, 600):
                    bridge.kill()
                if at in (300, 650):
                    bridge.start()
                if at == 400:
                    service.kill()
                    gone_s = time.monotonic()
                for kind in ("new", "end"):
                    event = frigate_event(kind, name, camera, path if kind == "end" else path[:1])
                    client.publish("frigate/events", event)
            time.sleep(max(0.0, away_s - (time.monotonic() - gone_s)))
            away_s, back_s = time.monotonic() - gone_s, time.monotonic()
            service.start()
            wait_for(lambda: stored(service) == wanted)
            caught_up_s = time.monotonic() - back_s
            time.sleep(5.0)  # what would still be posted twice
            found = stored(service)
        client.close()
    told = {"people": len(walks), "stored": sum(found.values()), "service_away_s": round(away_s)}
    _say({**told, "bridge_killed": 2, "caught_up_s": round(caught_up_s, 1)})
    return found == wanted


def load(folder: Path, cameras: int, seconds: float) -> bool:
    """True if the bridge stays within half a core and nothing is lost."""
    with running(folder) as service, broker(folder) as port:
        for number in range(cameras):
            service.http.post("/cameras", json={**CAMERA, "id": f"cam{number}"}).raise_for_status()
        with bridged(folder, port, service.url, feeds="axis:cams/+/scene") as bridge:
            time.sleep(cameras * 0.02 + 3)  # states and discovery go out
            process = psutil.Process(bridge.process.pid)
            before, begun_s = process.cpu_times(), time.monotonic()
            command = [sys.executable, "-m", __spec__.name, "publish", "--port", str(port)]
            command += ["--cameras", str(cameras), "--seconds", str(seconds)]
            published = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
            after, took_s = process.cpu_times(), time.monotonic() - begun_s
            cpu = (after.user + after.system - before.user - before.system) / took_s
            wait_for(lambda: sum(stored(service).values()) == published["people"], timeout_s=30)
            memory = process.memory_info().rss / 1e6
    told = {**published, "took_s": round(took_s), "bridge_cores": round(cpu, 3)}
    _say({**told, "bridge_mb": round(memory), "most_cores": _MOST_CPU})
    return cpu <= _MOST_CPU


def publish(port: int, cameras: int, seconds: float) -> bool:
    """Publish Axis' frames as of so many cameras; each person walks for some seconds."""
    client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTv5)
    client.connect("127.0.0.1", port)
    client.loop_start()
    rng, begun_s = random.Random(7), time.time()
    offsets = [[rng.random() * _WALK_S for _ in range(_AT_ONCE)] for _ in range(cameras)]
    frames, behind_s = 0, 0.0
    seen: dict[str, list[float]] = {}
    for step in range(int(seconds * _HZ)):
        now_s = begun_s + step / _HZ
        behind_s = max(behind_s, time.time() - now_s)
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(now_s)) + f".{now_s % 1:.6f}"[2:]
        for number in range(cameras):
            detections = []
            for who, offset in enumerate(offsets[number]):
                lap, place = divmod(now_s - begun_s + offset, _WALK_S)
                x, name = 0.1 + 0.05 * place, f"{number}-{who}-{lap:g}"
                box = {"left": x, "top": 0.3, "right": x + 0.04, "bottom": 0.3 + 0.04 * place}
                kind = {"type": "Human", "score": 0.8}
                detections.append({"object_track_id": name, "bounding_box": box, "class": kind})
                seen.setdefault(name, [now_s, now_s])[1] = now_s
            frame = {"channel_id": 1, "timestamp": stamp, "detections": detections}
            client.publish(f"cams/cam{number}/scene", json.dumps(frame), qos=1)
            frames += 1
        time.sleep(max(0.0, begun_s + (step + 1) / _HZ - time.time()))
    client.publish("end", b"", qos=1).wait_for_publish(30)
    # Five points over two seconds are a track.
    long_enough = sum(last - first >= 2.0 for first, last in seen.values())
    _say({"frames": frames, "people": long_enough, "behind_s": round(behind_s, 2)})
    return True


def _say(what: dict[str, float]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")


def main() -> int:
    """Run what is asked for; 1 where it is beyond its limits."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("what", choices=("people", "load", "publish"), nargs="?", default="people")
    asked.add_argument("--away-s", type=float, default=60.0)
    asked.add_argument("--cameras", type=int, default=200)
    asked.add_argument("--seconds", type=float, default=60.0)
    asked.add_argument("--port", type=int, default=0)
    given = asked.parse_args()
    if given.what == "publish":
        return 0 if publish(given.port, given.cameras, given.seconds) else 1
    within: Callable[[Path], bool] = (
        (lambda folder: people(folder, given.away_s))
        if given.what == "people"
        else (lambda folder: load(folder, given.cameras, given.seconds))
    )
    with tempfile.TemporaryDirectory() as folder:
        return 0 if within(Path(folder)) else 1


if __name__ == "__main__":
    sys.exit(main())
