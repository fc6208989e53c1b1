"""When a report is due, and that it is told and mailed once: late rather than never."""

import os
import signal
from datetime import UTC, datetime, timedelta

import pytest
from pydantic import ValidationError

from service.alerts.staleness import StaleWatch
from service.job_queue import JobQueue
from service.operations.troubles import find_troubles
from service.reports.sending import due_at, mail_text, next_period
from service.reports.weekly import make_report
from service.settings import Settings
from service.store import reports
from service.store.alerts import AlertRecord
from service.store.journal import activity_after
from service.workers.context import JobContext
from service.workers.upkeep.reconciliation import run_reconcile
from service.workers.upkeep.reports import ReportRounds
from tests.running import RunningService, free_port, wait_for
from tests.service.fleet_bench import Fleet
from tests.service.reports.rows import BEGIN, END, some_weeks

MAIL = {"report_from": "surefoot@example.org", "report_to": "ada@example.org, bo@example.org"}


def moment(text):
    return datetime.fromisoformat(text)


@pytest.mark.parametrize(
    ("now", "due"),
    [
        ("2026-03-30T04:59:59Z", "2026-03-23T06:00:00Z"),  # winter: an hour ahead of UTC
        ("2026-03-30T05:00:00Z", "2026-03-30T05:00:00Z"),  # summer: two
        ("2026-04-05T21:00:00Z", "2026-03-30T05:00:00Z"),  # Sunday evening
    ],
)
def test_it_is_due_at_an_hour_of_the_cameras_clock(now, due):
    mondays = Settings(report_day="monday", timezone="Europe/Copenhagen")
    assert due_at(mondays, moment(now)) == moment(due)
    assert due_at(Settings(), moment(now)) is None


def test_an_hour_that_the_clocks_leave_out_is_due_an_hour_later():
    settings = Settings(report_day="sunday", report_hour=2, timezone="Europe/Copenhagen")
    due = due_at(settings, moment("2026-03-29T12:00:00Z"))
    assert due == moment("2026-03-29T01:00:00Z")


@pytest.fixture
def office(settings):
    """A store with two knocks, and a service that reports on the day before today."""
    yesterday = f"{datetime.now(UTC) - timedelta(days=1):%A}".lower()
    changed = settings.model_copy(
        update={"report_day": yesterday, "report_hour": 0, "public_url": "https://watch.example/"}
    )
    fleet = Fleet(changed)
    for n in (1, 2):
        fleet.add(f"c{n}", f"Corner {n}")
        fleet.knock(f"c{n}")
    yield fleet
    fleet.close()


def context_of(fleet, **changes):
    settings = fleet.settings.model_copy(update=changes)
    return JobContext(settings=settings, store=fleet.store, queue=JobQueue(fleet.store.engine))


def last(fleet):
    with fleet.store.read() as session:
        return reports.newest(session, datetime.now(UTC))


def test_the_first_comes_at_once_and_the_next_begins_where_it_ended(office):
    context = context_of(office)
    rounds = ReportRounds()
    for _ in range(3):
        rounds.run(context)
    first = last(office)
    assert datetime.now(UTC) - timedelta(days=2) <= first.due_at <= datetime.now(UTC)
    with office.store.read() as session:
        now = first.due_at + timedelta(days=8)
        assert next_period(session, context.settings, first.due_at) is None
        assert next_period(session, context.settings, now) == (
            first.due_at,
            first.due_at + timedelta(days=7),
        )
        late = first.due_at + timedelta(days=25)  # it was switched off for three weeks
        assert next_period(session, context.settings, late) == (
            first.due_at,
            first.due_at + timedelta(days=21),
        )
        year = next_period(session, context.settings, first.due_at + timedelta(days=365))
        assert year[1] - year[0] == timedelta(days=7)


def test_a_report_of_a_clock_that_was_set_back_stops_none(office):
    with office.store.write() as session:
        session.execute(reports.ReportRecord.__table__.insert().values(
            id="x", due_at=datetime(2126, 1, 1, tzinfo=UTC), made_at=office.now, subject="s",
            text="t",
        ))  # fmt: skip
    ReportRounds().run(context_of(office))
    assert last(office).id != "x"


def test_webhooks_of_all_kinds_are_told_once(post_room, inbox, office):
    for more in ({}, {"kinds": ["drift"]}, {"format": "alertmanager"}):
        post_room.hook(inbox.url, **more)
    hook = post_room.http.get("/webhooks").json()["items"][0]
    rounds = ReportRounds()
    for _ in range(2):
        rounds.run(context_of(office))
    for each in post_room.http.get("/webhooks").json()["items"]:
        waiting = post_room.log(each)
        assert [d["type"] for d in waiting] == (
            ["report.weekly"] if each["id"] == hook["id"] else []
        )
    post_room.send(hook)
    (message,) = inbox.received
    data = message.json["data"]
    assert [each["name"] for each in data["moved"]] == []  # they moved after it was due
    assert (data["cameras"], len(data["weeks"])) == (3, 8)
    assert moment(data["to"]) == last(office).due_at


def test_a_mail_says_what_the_report_says(settings):
    changed = settings.model_copy(
        update={"timezone": "Europe/Copenhagen", "public_url": "https://watch.example/"}
    )
    fleet = Fleet(changed)
    some_weeks(fleet)
    fleet.add("quiet", "The quay", state="no_data")
    with fleet.store.read() as session:
        report = make_report(session, changed, moment(BEGIN), moment(END))
    fleet.close()
    lines = mail_text(report, changed).splitlines()
    assert lines[0] == "surefoot: 1 moved, 1 silent (23 Mar 2026 to 30 Mar 2026)"
    assert lines[2].startswith("4 cameras, 23 Mar 2026 to 30 Mar 2026; as of ")
    assert lines[3:] == [
        "",
        "Moved (1)",
        "- Corner 1: tilt +3.0°, since Tue 24 Mar, 10:40; put back by Ada after 3 hours",
        "",
        "Clocks and lenses (1)",
        "- Corner 1: people seem to walk too fast or too slowly: its clock or frame rate looks "
        "wrong, since Fri 20 Mar, 09:00; fixed by Bo after 4 days",
        "",
        "Other alerts (1)",
        "- 3 cameras of bytetrack: a wrong clock, since Thu 26 Mar, 09:00; ended by itself after "
        "60 minutes",
        "",
        "False alarms (1)",
        "- Corner 2: a wrong clock, since Wed 25 Mar, 09:00; false alarm by Bo after 30 minutes",
        "",
        "Silent now (1): The quay",
        "",
        "Alerts a week, the last 8: 0, 0, 0, 0, 0, 1, 1, 3",
        "Most often: Corner 1 (2)",
        "",
        "https://watch.example/ui/report?from=2026-03-23&to=2026-03-30",
    ]


@pytest.fixture
def post_office(tmp_path, monkeypatch):
    """A mail server that takes mail over TLS by a password, and the settings for it."""
    mailboxes = pytest.importorskip("tests.service.reports.mailbox", exc_type=ImportError)
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "ca.pem"))
    with mailboxes.mailbox(tmp_path) as made:
        made.settings = {
            **MAIL,
            "smtp_host": "127.0.0.1",
            "smtp_port": made.port,
            "smtp_user": mailboxes.USER,
            "smtp_password": mailboxes.PASSWORD,
        }
        yield made


def test_it_is_mailed_once_over_tls_by_whom_the_server_knows(office, post_office):
    context = context_of(office, **post_office.settings)
    for rounds in (ReportRounds(), ReportRounds()):
        rounds.run(context)
        rounds.run(context)
    (mail,) = post_office.mails
    assert post_office.senders == [("surefoot@example.org", ["ada@example.org", "bo@example.org"])]
    assert (mail["From"], mail["To"]) == (MAIL["report_from"], MAIL["report_to"])
    assert mail["Subject"].startswith("surefoot: 0 moved, 0 silent (")
    assert "https://watch.example/ui/report?from=" in mail.get_content()
    assert mail["Auto-Submitted"] == "auto-generated"
    assert last(office).mailed_at is not None


def test_what_is_refused_is_told_of_and_tried_again(office, post_office):
    post_office.answer = "451 try again later"
    context = context_of(office, webhook_retry_s="3600,7200", **post_office.settings)
    rounds = ReportRounds()
    for _ in range(2):  # the second finds that its time has not come
        rounds.run(context)
    assert post_office.mails == []
    with office.store.read() as session:
        (words,) = [
            each.words
            for each in find_troubles(session, context.settings)
            if "report" in each.words
        ]
    assert "try again later" in words
    post_office.answer = "250 OK"
    ReportRounds().run(context)  # a worker that starts tries at once
    assert len(post_office.mails) == 1
    assert (last(office).error, last(office).mailed_at is not None) == (None, True)


def test_one_address_that_is_refused_keeps_no_other_from_it(office, post_office):
    post_office.unknown = {"bo@example.org"}
    context = context_of(office, **post_office.settings)
    for _ in range(2):
        ReportRounds().run(context)
    assert post_office.senders == [("surefoot@example.org", ["ada@example.org"])]
    assert last(office).error == "refused: bo@example.org"


def test_a_server_that_nobody_vouches_for_is_told_no_password(office, post_office, monkeypatch):
    monkeypatch.delenv("SSL_CERT_FILE")
    ReportRounds().run(context_of(office, **post_office.settings))
    assert post_office.mails == []
    assert "CERTIFICATE_VERIFY_FAILED" in last(office).error


@pytest.mark.nightly
def test_a_worker_killed_while_it_mails_mails_again_and_then_no_more(office, post_office, settings):
    changes = {
        "port": free_port(),
        "trainings": "off",
        "workers": 1,
        "report_day": office.settings.report_day,
        "report_hour": 0,
        **post_office.settings,
    }
    running = RunningService(settings.model_copy(update=changes))
    post_office.wait_s = 3.0
    running.start()
    try:
        wait_for(lambda: post_office.mails, every_s=0.02)
        os.kill(running.worker_pid(), signal.SIGKILL)  # the server's answer finds nobody
        post_office.wait_s = 0.0
        wait_for(lambda: last(office) is not None and last(office).mailed_at is not None)
        assert len(post_office.mails) == 2
        assert len(set(post_office.ids())) == 1
    finally:
        running.stop()
    ReportRounds().run(context_of(office, **post_office.settings))
    assert len(post_office.mails) == 2


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"smtp_host": "mail.example"}, "SUREFOOT_REPORT_FROM and SUREFOOT_REPORT_TO"),
        ({"report_to": "ada"}, "addresses as name@host"),
        ({"report_to": "a@b\nBcc: c@d"}, "addresses as name@host"),
        ({"smtp_tls": "off", "smtp_password": "secret"}, "over TLS alone"),
        ({"report_day": "someday"}, "monday"),
    ],
)
def test_settings_that_cannot_be_are_refused(given, words):
    with pytest.raises(ValidationError, match=words):
        Settings(**given)


def test_the_password_is_shown_nowhere():
    settings = Settings(smtp_host="mail.example", smtp_password="a pass word", **MAIL)
    assert "a pass word" not in repr(settings)


def test_what_nobody_took_up_is_mailed_once_and_again_where_it_was_not_taken(office, post_office):
    """Only webhooks heard of an escalation."""
    context = context_of(office, report_day=None, escalate_after_min=30.0, **post_office.settings)
    long_ago = datetime.now(UTC) - timedelta(minutes=31)
    with office.store.write() as session:
        found = {a.camera_id: a for a in session.query(AlertRecord)}
        for record in found.values():
            record.opened_at = record.changed_at = long_ago
        seen = found["c2"]
        seen.acknowledged_by, seen.acknowledged_at = "Ada", long_ago
    ReportRounds().run(context)
    assert post_office.mails == []  # it is not escalated yet
    run_reconcile(context, StaleWatch())
    post_office.answer = "451 try again later"
    ReportRounds().run(context)
    post_office.answer = "250 OK"
    for _ in range(2):
        ReportRounds().run(context)
    (mail,) = post_office.mails
    assert post_office.senders[0][1] == ["ada@example.org", "bo@example.org"]
    assert mail["Subject"] == "surefoot: nobody took up 1 alert"
    told, _, url = mail.get_content().strip().splitlines()
    assert told.startswith("- Corner 1: tilt +3.0°, since ")
    assert told.endswith("; nobody took it up in 31 minutes")
    assert url == "https://watch.example/ui/alerts?acknowledged=false"
    with office.store.read() as session:
        log = [entry.what for entry in activity_after(session, "c1", 0, 100)]
    assert log[-2:] == ["alert.escalated", "alert.mailed"]
