"""The connection to an MQTT 5 broker: a lasting session in, retained topics out."""

import logging
import ssl
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from paho.mqtt.client import Client, MQTTMessage, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from surefoot.bridge.inbox import RECEIVE_MAXIMUM, Inbox
from surefoot.bridge.values import MAX_MESSAGE_BYTES

log = logging.getLogger("surefoot.bridge")

_SESSION_S = 7 * 86_400  # for which a broker keeps what comes while nobody is connected
_KEEPALIVE_S = 30
_PACKET_BYTES = MAX_MESSAGE_BYTES + 64 * 1024  # with the topic and what a client says beside it
_LONGEST_S = 30  # between two attempts to connect
_PORTS = {"mqtt": 1883, "mqtts": 8883}


@dataclass(frozen=True, kw_only=True)
class Address:
    """A broker: `url` is `mqtt://host:port` or `mqtts://…`, by TLS and these certificates."""

    url: str
    client_id: str
    user: str | None = None
    password: str | None = None
    ca_file: Path | None = None

    @property
    def uses_tls(self) -> bool:
        """True for `mqtts`."""
        return urlsplit(self.url).scheme == "mqtts"

    def tls_context(self) -> ssl.SSLContext:
        """The certificates that the broker's is checked by.

        Raises:
            OSError: `ca_file` cannot be read, or has no certificate.
        """
        return ssl.create_default_context(cafile=self.ca_file)

    @property
    def host_and_port(self) -> tuple[str, int]:
        """Where it listens."""
        parts = urlsplit(self.url)
        return parts.hostname or "", parts.port or _PORTS[parts.scheme]


class Broker:
    """A client that connects again by itself; what it says is retained, and said again then.

    `note_connection` is told True once messages come, False once none do.
    """

    def __init__(
        self,
        address: Address,
        topics: Sequence[str],
        availability: str,
        note_connection: Callable[[bool], None],
    ) -> None:
        self._note_connection = note_connection
        self.inbox = Inbox(lambda mid: self._client.ack(mid, 1))
        self._topics, self._availability = topics, availability
        self._lock = threading.Lock()
        self._said: dict[str, str] = {}
        self._connected = self._resumed = False
        self._client = client = Client(
            CallbackAPIVersion.VERSION2,
            client_id=address.client_id,
            protocol=MQTTv5,
            manual_ack=True,
            reconnect_on_failure=True,
        )
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_subscribe, client.on_message = self._on_subscribe, self._on_message
        client.on_connect_fail = self._on_connect_fail
        client.reconnect_delay_set(1, _LONGEST_S)
        client.will_set(availability, "offline", qos=1, retain=True)
        if address.user is not None:
            client.username_pw_set(address.user, address.password)
        if address.uses_tls:
            client.tls_set_context(address.tls_context())
        self._address = address

    def start(self) -> None:
        """Connect, in a thread of its own, as often as it takes."""
        properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        properties.SessionExpiryInterval = _SESSION_S
        properties.ReceiveMaximum = RECEIVE_MAXIMUM
        properties.MaximumPacketSize = _PACKET_BYTES
        host, port = self._address.host_and_port
        self._client.connect_async(
            host, port, _KEEPALIVE_S, clean_start=False, properties=properties
        )
        self._client.loop_start()

    @property
    def connected(self) -> bool:
        """True while messages come."""
        return self._connected

    def say(self, topic: str, payload: str) -> None:
        """Publish a retained message if it is news; an empty one takes the topic away."""
        with self._lock:
            if self._said.get(topic, "") == payload:
                return
            if payload:
                self._said[topic] = payload
            else:
                del self._said[topic]
            if self._connected:
                self._client.publish(topic, payload, qos=1, retain=True)

    def stop(self) -> None:
        """Say that nobody is there, and go; the session stays."""
        if self._client.is_connected():
            last = self._client.publish(self._availability, "offline", qos=1, retain=True)
            last.wait_for_publish(2.0)
        self._client.disconnect()
        self._client.loop_stop()

    def _on_connect(self, client: Client, _: Any, flags: Any, reason: Any, __: Any) -> None:
        if reason.is_failure:
            log.warning("mqtt_refused", extra={"reason": str(reason)})
            return
        self._resumed = flags.session_present
        self.inbox.begin()
        once = SubscribeOptions(qos=1, retainHandling=SubscribeOptions.RETAIN_SEND_IF_NEW_SUB)
        client.subscribe([(topic, once) for topic in self._topics])
        with self._lock:
            self._connected = True
            for topic, payload in self._said.items():
                client.publish(topic, payload, qos=1, retain=True)

    def _on_connect_fail(self, _: Client, __: Any) -> None:
        reason = str(sys.exc_info()[1])  # paho calls from where it has caught it, and tells no more
        log.warning("mqtt_away", extra={"url": self._address.url, "reason": reason})

    def _on_subscribe(self, _: Client, __: Any, ___: int, reasons: list[Any], ____: Any) -> None:
        """Tell that all is in place: what is published from here on is not lost."""
        refused = {
            topic: str(reason)
            for topic, reason in zip(self._topics, reasons, strict=True)
            if reason.is_failure
        }
        if refused:
            log.error("mqtt_topics_refused", extra={"topics": refused})
        log.info("mqtt_connected", extra={"session_present": self._resumed})
        self._note_connection(True)

    def _on_disconnect(self, _: Client, __: Any, ___: Any, reason: Any, ____: Any) -> None:
        self.inbox.begin()  # from here on paho would acknowledge by the next connection
        with self._lock:
            self._connected = False
        log.warning("mqtt_disconnected", extra={"reason": str(reason)})
        self._note_connection(False)

    def _on_message(self, _: Client, __: Any, message: MQTTMessage) -> None:
        try:
            topic = message.topic
        except UnicodeDecodeError:  # not every broker checks; an error would end paho's thread
            topic = repr(bytes(message._topic))
        self.inbox.add(topic, bytes(message.payload), message.mid, message.qos)
