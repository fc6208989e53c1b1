"""Settings from `SUREFOOT_...` variables and flags: the only reader of the environment."""

import difflib
import os
from collections.abc import Mapping
from datetime import UTC, tzinfo
from ipaddress import IPv4Network, IPv6Network
from pathlib import Path
from typing import Annotated, Literal
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, Field, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from service import setting_values as values
from service.data_dir import DATABASE, WEIGHTS

_PREFIX = "SUREFOOT_"
_OTHERS = ("SUREFOOT_TOKEN", "SUREFOOT_TOKEN_FILE", "SUREFOOT_URL")  # of commands, no settings
_ALIKE = 0.85  # of a misspelled name, by `difflib`
_TOPIC = r"^[^+#\x00]+$"
Networks = Annotated[str, values.readable(values.read_networks)]


class Settings(BaseSettings):
    """Everything that an operator can set; each field is also `SUREFOOT_<FIELD>`."""

    model_config = SettingsConfigDict(env_prefix=_PREFIX, frozen=True)

    data_dir: Path = Field(Path("surefoot-data"), description="database and weights live here")
    database_url: Annotated[str, AfterValidator(values.read_database_url)] | None = Field(
        None,
        repr=False,
        description="postgresql://user:password@host/name; unset: an SQLite file in data_dir",
    )
    database_connections: int = Field(
        10, ge=3, description="to PostgreSQL, of a process; a worker's job engine has five more"
    )
    host: str = Field("127.0.0.1", description="address that the API listens on")
    port: int = Field(8080, ge=0, le=65535, description="port that the API listens on")
    allowed_hosts: str = Field(
        "", description="names, with commas, that this service is asked by besides its own"
    )
    auth: Literal["auto", "on", "off"] = Field(
        "auto", description="whether tokens are needed; auto: unless only this machine is served"
    )
    session_hours: float = Field(12.0, gt=0, le=8760, description="hours that a page's login holds")
    proxy_secret: str | None = Field(
        None,
        min_length=16,
        repr=False,
        description="what a proxy that logs people in says in X-Surefoot-Proxy",
    )
    proxy_from: Networks = Field("", description="CIDRs, with commas, that such a proxy asks from")
    proxy_user_header: str = Field("X-Forwarded-User", description="its header of the person")
    proxy_role_header: str = Field(
        "X-Forwarded-Role", description="its header of what that may: read, operate or admin"
    )
    workers: int = Field(
        default_factory=values.one_a_core,
        ge=0,
        description="local worker processes that `serve` starts: one a core, four at the most",
    )
    secret_key: Annotated[str, values.readable(values.read_key)] | None = Field(
        None,
        repr=False,
        description="32 bytes in base64 that seal stored secrets; unset: secret.key in data_dir",
    )
    copy_before_migration: bool = Field(
        True, description="copy the database before its schema changes; without room: no start"
    )

    trainings: Literal["on", "idle", "off"] = Field(
        "idle",
        description="whether trainings begin by themselves; idle: and go on only while no estimate "
        "waits for a worker. The served pose needs none, and off, too, does what a person asks for",
    )
    recipe: Literal["default", "paper"] = Field("default", description="recipe of new trainings")
    epochs: int | None = Field(
        None, ge=1, description="epochs of a training; the recipe's if unset"
    )
    seed: int = Field(0, ge=0, description="seed of trainings and bootstraps")
    trainings_at_once: int = Field(1, ge=1, description="over all workers")
    worker_nice: int = Field(
        5, ge=0, le=19, description="how far workers yield to the API on a busy machine"
    )
    training_nice: int = Field(
        19, ge=0, le=19, description="how much a training yields to all else; 0: not at all"
    )
    training_threads: int = Field(1, ge=1, description="CPU threads of a training")

    window_tracks: int = Field(400, ge=5, description="newest tracks that an estimate uses")
    window_days: float = Field(
        7.0, gt=0, description="age of the oldest of them, before the newest"
    )
    max_ahead_s: float = Field(
        60.0, ge=0, description="seconds that a track's times may be ahead of our clock"
    )
    no_data_after_h: float = Field(
        24.0, gt=0, description="hours without a track until no_data, whatever the rhythm"
    )
    no_data_min_s: float = Field(600.0, ge=0, description="shortest silence that is no_data")
    false_no_data_per_year: float = Field(
        1.0, gt=0, description="false no_data alerts of a camera in a year"
    )
    rhythm_days: int = Field(7, ge=1, description="days that a camera's rhythm is learned of first")
    timezone: Annotated[str, AfterValidator(values.read_zone)] = Field(
        "UTC", description="IANA zone of the cameras: their hours and weekends"
    )

    false_alarms_per_year: float = Field(
        1.0, gt=0, le=1000, description="drift alarms of a camera that stands still, a year"
    )
    max_sources: int = Field(16, ge=1, description="sources that may post tracks for one camera")
    source_silent_h: float = Field(
        6.0, gt=0, description="hours of silence after which another source takes over"
    )

    moved_prior: float = Field(
        0.2, gt=0, lt=1, description="how likely a camera has moved, before any track of a window"
    )
    drift_certainty: float = Field(
        0.99, ge=0.5, lt=1, description="how likely a camera must have moved, for an alert"
    )
    drift_floor_deg: float = Field(1.0, ge=0, description="and by more than this angle")
    drift_floor_m: float = Field(0.3, ge=0, description="or this height")
    drift_people: int = Field(
        12, ge=1, description="people who must come after an answer, for a pose to be judged"
    )
    drift_clear_ratio: float = Field(0.7, gt=0, le=1, description="alert clears below this share")

    escalate_after_min: float | None = Field(
        None,
        gt=0,
        description="minutes until an alert that nobody took up is told of once more; unset: never",
    )
    silence_max_days: float = Field(30.0, gt=0, description="longest silence of an alert")
    maintenance_max_days: float = Field(30.0, gt=0, description="longest maintenance window")
    group_cameras: int = Field(3, ge=2, description="cameras of a tracker that make one alert")
    group_share: float = Field(0.5, gt=0, le=1, description="and this share of its cameras")
    group_within_s: float = Field(3600.0, gt=0, description="that began to move within this time")

    flow_tracks: int = Field(2_000, ge=50, description="newest tracks that a flow map is made of")
    flow_half_life_days: float = Field(
        30.0, gt=0, description="age at which a track counts half in it"
    )
    flow_unsure_tracks: int = Field(
        100, ge=0, description="newest tracks that it leaves out: a move may be unnoticed"
    )

    keep_days: float = Field(30.0, gt=0, description="days from a track's arrival to its deletion")
    keep_tracks: int = Field(
        20_000, ge=5, description="tracks kept of a camera: the last to arrive"
    )
    keep_mb: float = Field(200.0, ge=0, description="MiB of tracks kept for a camera; 0: any")
    keep_estimates: int = Field(20_000, ge=1, description="history kept for each camera")
    keep_activity_days: float = Field(
        1825.0, ge=30, description="age at which entries of the log of what was done are deleted"
    )
    keep_alerts_days: float = Field(
        1825.0, ge=30, description="age at which ended alerts are deleted"
    )
    keep_trainings: int = Field(
        50, ge=2, description="trainings kept for each camera, beside those of its models"
    )
    keep_references: int = Field(
        50, ge=2, description="references and prior poses kept that no estimate is of"
    )
    keep_events: int = Field(10_000, ge=1, description="events kept for /events to resume from")

    snapshots: Literal["off", "features", "pictures"] = Field(
        "off",
        description="still images of cameras, as a second witness: `features` keeps none of them",
    )

    snapshot_every_min: float = Field(
        60.0, ge=1, description="minutes between pictures that are asked of a `snapshot_url`"
    )
    snapshot_allow: Networks = Field(
        "", description="CIDRs, with commas, of private addresses that images may be fetched from"
    )
    snapshot_basic_http: bool = Field(
        False, description="allow credentials of cameras by Basic over http, which is in clear"
    )

    webhook_allow: Networks = Field(
        "", description="CIDRs, with commas, of private addresses that webhooks may go to"
    )
    webhook_retry_s: Annotated[str, values.readable(values.read_delays)] = Field(
        "5,30,120,600,3600,10800,21600,43200",
        description="seconds from a failed delivery to its next attempt; the last one repeats",
    )
    webhook_patience_h: float = Field(
        72.0, gt=0, description="hours of failing that end a delivery, and disable its webhook"
    )
    alertmanager_refresh_s: float = Field(
        60.0, ge=1, description="seconds between tellings of all that fires; it forgets"
    )
    keep_deliveries_days: float = Field(
        30.0, gt=0, description="age at which ended deliveries are deleted"
    )
    report_day: Literal[*values.WEEKDAYS] | None = Field(  # type: ignore[valid-type]
        None, description="day of the weekly report, to webhooks and by mail; unset: none is sent"
    )
    report_hour: int = Field(7, ge=0, le=23, description="and its hour, by TIMEZONE")
    report_from: Annotated[str, values.readable(values.read_addresses)] = Field(
        "", description="address that reports are mailed from"
    )
    report_to: Annotated[str, values.readable(values.read_addresses)] = Field(
        "", description="addresses, with commas, that reports and escalations are mailed to"
    )
    smtp_host: str | None = Field(None, description="mail server; unset: nothing is mailed")
    smtp_port: int | None = Field(
        None, ge=1, le=65535, description="its port; unset: 587 for starttls, 465 for tls, else 25"
    )
    smtp_tls: Literal["starttls", "tls", "off"] = Field(
        "starttls", description="whether mail is sent in the open: only by `off`, and no password"
    )
    smtp_user: str | None = Field(None, description="user at the mail server")
    smtp_password: str | None = Field(None, repr=False, description="and the password")
    public_url: Annotated[str, values.readable(values.read_public_url)] | None = Field(
        None, description="where people reach this service, for links"
    )

    mqtt_url: Annotated[str, values.readable(values.read_mqtt_url)] | None = Field(
        None,
        description="mqtt://host:1883 or mqtts://host:8883: a broker; `serve` then runs a bridge",
    )
    mqtt_user: str | None = Field(None, description="its user at the broker")
    mqtt_password: str | None = Field(None, repr=False, description="and the password")
    mqtt_ca_file: Path | None = Field(
        None, description="certificates that a broker's is checked by; unset: this machine's"
    )
    mqtt_client_id: str = Field(
        "surefoot-bridge",
        min_length=1,
        description="by which the broker knows its session; no two bridges may share one",
    )
    mqtt_prefix: str = Field(
        "surefoot", pattern=_TOPIC, description="what the topics of tracks, states, alerts begin by"
    )
    mqtt_frigate: str = Field(
        "frigate", pattern=f"{_TOPIC}|^$", description="Frigate's topic_prefix; empty: no Frigate"
    )
    mqtt_frigate_url: Annotated[str, values.readable(values.read_http_url)] | None = Field(
        None,
        description="http://host:5000 of Frigate, which is asked for whose end no broker brought",
    )
    mqtt_cameras: Annotated[str, values.readable(values.read_camera_names)] = Field(
        "", description="sources' names of cameras, where they are others: name=id, with commas"
    )
    mqtt_feeds: str = Field(
        "", description="topics of frames: axis:cameras/+/scene, onvif-grid:..., with commas"
    )
    mqtt_spool_mb: float = Field(
        512.0, gt=0, description="MiB of tracks that the bridge keeps while the service is away"
    )
    mqtt_discovery: str = Field(
        "homeassistant",
        pattern=f"{_TOPIC}|^$",
        description="prefix by which Home Assistant finds devices; empty: no discovery",
    )

    max_connections: int = Field(1000, ge=1, description="open connections")
    connections_per_address: int = Field(
        500, ge=0, description="of them from one address; 0: as many as there may be"
    )
    head_timeout_s: float = Field(
        10.0, gt=0, description="within which the headers of a request must have come"
    )
    stall_timeout_s: float = Field(
        15.0, gt=0, description="within which more of a body must come, or of an answer be taken"
    )
    http_at_once: int = Field(8, ge=1, description="reads, and writes, that are worked on at once")
    http_waiting: int = Field(64, ge=0, description="of each that wait meanwhile; more get a 503")
    http_wait_s: float = Field(
        5.0, gt=0, description="longest wait of a request for its turn, and for the store"
    )
    max_streams: int = Field(
        200, ge=1, description="open streams of /events; a caller has a quarter of these at most"
    )
    max_body_mb: float = Field(1.0, gt=0, description="MiB of a body")
    max_tracks_body_mb: float = Field(32.0, gt=0, description="MiB of a body with tracks")
    max_snapshot_mb: float = Field(8.0, gt=0, description="MiB of a still image")
    max_bodies_mb: float = Field(256.0, gt=0, description="MiB of all bodies in memory at once")
    caller_rate: float = Field(
        500.0, ge=0, description="requests a second of a token, or an address; 0: any"
    )
    camera_rate: float = Field(
        100.0, ge=0, description="posts of tracks a second for a camera; 0: any"
    )
    max_cameras: int = Field(2000, ge=1, description="cameras that may be registered")
    min_free_mb: float = Field(
        64.0, ge=0, description="MiB of free disk below which /readyz is not ready; 0: any"
    )

    reconcile_s: int = Field(
        5, ge=1, le=59, description="seconds between reconciles, of ten cameras a second at most"
    )
    estimate_rest: float = Field(
        1.0, ge=0, le=60, description="a camera rests so many times as long as its last look took"
    )
    stale_after_s: float = Field(
        600.0, gt=1, description="tracks that wait for longer make their camera's alert `stale`"
    )
    stale_failures: int = Field(3, ge=1, description="and so many looks in a row that fail")
    estimate_limit_s: float = Field(
        600.0, gt=1, description="a look at a camera that takes longer hangs: its worker is ended"
    )
    estimate_cpu_s: float = Field(
        120.0, gt=1, description="CPU seconds of a look; after more it ends, and leaves tracks out"
    )
    delivery_limit_s: float = Field(300.0, gt=60, description="the same of a delivery job")
    upkeep_limit_s: float = Field(1800.0, gt=1, description="the same of a step of the upkeep")
    training_limit_s: float = Field(
        21_600.0, gt=1, description="a training that takes longer has failed"
    )
    worker_max_mb: int = Field(
        1_500, ge=50, description="a worker that grows beyond ends its jobs and is started anew"
    )
    worker_lost_s: float = Field(20.0, gt=1, description="silence after which a worker is lost")

    @property
    def zone(self) -> tzinfo:
        """The cameras' zone; UTC needs no zone database."""
        return UTC if self.timezone == "UTC" else ZoneInfo(self.timezone)

    @field_validator("*")
    @classmethod
    def _can_be_counted_by(cls, value: object, info: ValidationInfo) -> object:
        if isinstance(value, int | float):
            values.check_number(str(info.field_name), value)
        return value

    @field_validator("proxy_from")
    @classmethod
    def _proxies_prove_themselves(cls, value: str, info: ValidationInfo) -> str:
        if value and info.data.get("proxy_secret") is None:
            raise ValueError("SUREFOOT_PROXY_SECRET is needed, too: an address alone proves little")
        return value

    @field_validator("smtp_host")
    @classmethod
    def _mail_has_both_ends(cls, value: str | None, info: ValidationInfo) -> str | None:
        if value is not None and not (info.data.get("report_from") and info.data.get("report_to")):
            raise ValueError("SUREFOOT_REPORT_FROM and SUREFOOT_REPORT_TO are needed, too")
        return value

    @field_validator("smtp_password")
    @classmethod
    def _password_is_sealed(cls, value: str | None, info: ValidationInfo) -> str | None:
        if value is not None and info.data.get("smtp_tls") == "off":
            raise ValueError("it is sent over TLS alone, and SUREFOOT_SMTP_TLS is off")
        return value

    @property
    def webhook_networks(self) -> tuple[IPv4Network | IPv6Network, ...]:
        """Private networks that webhooks may go to."""
        return values.read_networks(self.webhook_allow)

    @property
    def snapshot_networks(self) -> tuple[IPv4Network | IPv6Network, ...]:
        """Private networks that images may be fetched from, and credentials sent to."""
        return values.read_networks(self.snapshot_allow)

    @property
    def proxy_networks(self) -> tuple[IPv4Network | IPv6Network, ...]:
        """Where proxies that log people in ask from."""
        return values.read_networks(self.proxy_from)

    @property
    def webhook_delays_s(self) -> tuple[float, ...]:
        """Seconds from each failed attempt to the next; the last one repeats."""
        return values.read_delays(self.webhook_retry_s)

    @property
    def database_path(self) -> Path:
        """The SQLite file of the application and its job engine, where no server is named."""
        return self.data_dir / DATABASE

    @property
    def store_url(self) -> str:
        """SQLAlchemy's URL of the database: the server's, or that of the SQLite file."""
        return self.database_url or f"sqlite:///{self.database_path.absolute()}"

    @property
    def weights_dir(self) -> Path:
        """Folder of weight files, named by their hash."""
        return self.data_dir / WEIGHTS

    def as_environment(self) -> dict[str, str]:
        """This process's environment with these settings in it, for a child process."""
        values = self.model_dump(mode="json", exclude_none=True)
        ours = {f"{_PREFIX}{name.upper()}": str(value) for name, value in values.items()}
        return {**os.environ, **ours}


def variables_without_effect(environment: Mapping[str, str]) -> dict[str, str]:
    """Return variables that look like settings and are none, with the ones to use instead.

    Two kinds: a setting's name without its prefix, and a misspelled name with the prefix. A
    variable is left out if the right one is set, too.
    """
    given = {name.upper() for name in environment}
    known = {f"{_PREFIX}{name.upper()}" for name in Settings.model_fields}
    found = {}
    for name in sorted(given - known - set(_OTHERS)):
        if name.startswith(_PREFIX):
            meant = difflib.get_close_matches(name, known, 1, _ALIKE)
        else:
            meant = [_PREFIX + name] if _PREFIX + name in known else []
        if meant and meant[0] not in given:
            found[name] = meant[0]
    return found
