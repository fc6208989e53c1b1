"""A real broker, a bridge that may be killed, and Frigate's messages of recorded people."""

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from paho.mqtt.client import CallbackAPIVersion, Client, MQTTv5

from models.tracks.scenes import Scene
from tests.running import free_port, wait_for

# Debian's is not on every PATH.
MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin")
needs_mosquitto = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed")


@contextmanager
def broker(folder: Path, *extra: str) -> Iterator[int]:
    """The port of a mosquitto of its own, with lines of its configuration beside the usual ones."""
    port = free_port()
    config = folder / "mosquitto.conf"
    lines = [f"listener {port} 127.0.0.1", "max_queued_messages 100000", *extra]
    if not any(line.startswith("allow_anonymous") for line in lines):
        lines.append("allow_anonymous true")
    config.write_text("\n".join([*lines, "user root", ""]))
    with (folder / "mosquitto.log").open("w") as log:
        process = subprocess.Popen([str(MOSQUITTO), "-c", str(config)], stdout=log, stderr=log)
    try:
        wait_for(lambda: _listens(port), every_s=0.02)
        yield port
    finally:
        process.terminate()
        process.wait(10)


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class RunningBridge:
    """A real `surefoot bridge`, which a test may kill and start again."""

    def __init__(self, folder: Path, broker_port: int, service_url: str, **settings: str) -> None:
        self.log = folder / "bridge.log"
        settings = {"url": f"mqtt://127.0.0.1:{broker_port}", **settings}
        given = {f"SUREFOOT_MQTT_{name.upper()}": value for name, value in settings.items()}
        self._environment = os.environ | given
        self._command = [sys.executable, "-m", "service.cli", "bridge", "--url", service_url]
        self._command += ["--data-dir", str(folder / "bridge")]
        self.process: subprocess.Popen[bytes]

    def start(self) -> None:
        with self.log.open("a") as log:
            self.process = subprocess.Popen(
                self._command, env=self._environment, stdout=log, stderr=log
            )

    def wait_connected(self, times: int) -> None:
        """Until it has connected so many times in all."""
        wait_for(lambda: self.log.read_text().count("mqtt_connected") >= times, every_s=0.02)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(10)

    def stop(self) -> int:
        self.process.terminate()
        return self.process.wait(10)


@contextmanager
def bridged(
    folder: Path, port: int, service_url: str, word: str = "mqtt_connected", **settings: str
) -> Iterator[RunningBridge]:
    """A bridge that has logged a word, until the end of the block."""
    running = RunningBridge(folder, port, service_url, **settings)
    running.start()
    try:
        wait_for(lambda: word in running.log.read_text(), every_s=0.02)
        yield running
    finally:
        if running.process.poll() is None:
            running.stop()


class Client5:
    """Another client of the broker: it publishes, and keeps what was said last of each topic."""

    def __init__(self, port: int, *topics: str) -> None:
        self.heard: dict[str, Any] = {}
        self._client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTv5)
        self._ready = threading.Event()
        self._client.on_message = self._on_message
        self._client.on_subscribe = lambda *_: self._ready.set()
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        for topic in topics:
            self._client.subscribe(topic, qos=1)
        assert not topics or self._ready.wait(10)

    def _on_message(self, _: Any, __: Any, message: Any) -> None:
        text = message.payload.decode()
        self.heard[message.topic] = json.loads(text) if text[:1] == "{" else text

    def publish(self, topic: str, document: Any, qos: int = 1) -> None:
        """Publish, and wait until the broker has it."""
        payload = document if isinstance(document, bytes) else json.dumps(document).encode()
        self._client.publish(topic, payload, qos=qos).wait_for_publish(20)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


def frigate_event(
    kind: str, name: str, camera: str, path: list[Any], label: str = "person", **more: Any
) -> dict[str, Any]:
    """A message of Frigate 0.16, with the fields that it has beside those that are read."""
    after = {
        "id": name,
        "camera": camera,
        "frame_time": path[-1][1] if path else 0.0,
        "label": label,
        "sub_label": None,
        "top_score": 0.83,
        "false_positive": False,
        "start_time": path[0][1] if path else 0.0,
        "end_time": path[-1][1] if kind == "end" and path else None,
        "box": [541, 215, 593, 388],
        "region": [411, 100, 731, 420],
        "stationary": False,
        "active": True,
        "current_zones": [],
        "path_data": path,
        **more,
    }
    return {"type": kind, "before": after, "after": after}


def paths_of(scene: Scene, shift_s: float) -> Iterator[tuple[str, list[Any]]]:
    """Names and paths of a scene's people as Frigate tells them, of those long enough to count."""
    width, height = scene.intrinsics.width, scene.intrinsics.height
    for track in scene.tracks:
        walk = track.trajectory
        path = [
            [[(u + 0.5) / width, (v + 0.5) / height], time_s + shift_s]
            for time_s, (u, v) in zip(walk.time_s.tolist(), walk.uv.tolist(), strict=True)
            if 0 <= u < width and 0 <= v < 0.98 * height
        ]
        times = [time_s for _, time_s in path]
        if len(path) >= 5 and times[-1] - times[0] > 2.0:
            yield track.track_id, path
