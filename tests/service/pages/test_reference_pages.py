"""The pages of settings and words: true, without a secret, for whom they are."""

import re

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError

from service.access import tokens
from service.access.tokens import TokenSpec
from service.app import create_app
from service.pages.reference import setting_rows
from service.settings import Settings
from service.store.engines.store import Store
from service.wording import alerts as alert_words
from service.wording.camera import STATES
from service.wording.glossary import WORDS

CANARY = "canary-0123456789-canary"


def test_settings_are_shown_as_they_are(settings):
    told = settings.model_copy(update={"drift_people": 17, "timezone": "Europe/Berlin"})
    with TestClient(create_app(told)) as http:
        page = http.get("/ui/settings").text
    rows = dict(re.findall(r"<tr><td><code>(\w+)</code></td><td>(.*?)</td>", page))
    assert set(rows) == {name.upper() for name in Settings.model_fields}
    assert rows["DRIFT_PEOPLE"] == "<strong>17</strong>"
    assert rows["TIMEZONE"] == "<strong>Europe/Berlin</strong>"
    assert rows["GROUP_SHARE"] == "0.5"
    assert rows["PUBLIC_URL"] == "unset"


def test_settings_page_shows_no_secret(settings):
    secret = [name for name, field in Settings.model_fields.items() if not field.repr]
    looks_secret = [n for n in Settings.model_fields if re.search("password|secret|key|token", n)]
    assert set(looks_secret) <= set(secret)
    hidden = dict.fromkeys(secret, CANARY)
    rows = {row.name: row for row in setting_rows(settings.model_copy(update=hidden))}
    assert CANARY not in str(rows)
    assert {rows[name.upper()].value for name in secret} == {"set, not shown"}


@pytest.mark.parametrize("name", ["public_url", "mqtt_frigate_url", "mqtt_url"])
def test_address_with_a_password_is_no_setting(name):
    scheme = "mqtt" if name == "mqtt_url" else "https"
    assert Settings(**{name: f"{scheme}://host.example"})
    with pytest.raises(ValidationError, match="is needed"):
        Settings(**{name: f"{scheme}://ada:{CANARY}@host.example"})


@pytest.mark.parametrize(("scope", "status"), [("read", 403), ("operate", 403), ("admin", 200)])
def test_settings_are_for_administrators_and_words_for_all(settings, scope, status):
    store = Store(settings)
    with store.write() as session:
        token = tokens.make_token(session, TokenSpec(name="ada", scopes=(scope,)), None).text
    store.close()
    headers = {"Authorization": f"Bearer {token}", "Accept": "text/html"}
    with TestClient(
        create_app(settings.model_copy(update={"auth": "on"})), headers=headers
    ) as http:
        assert http.get("/ui/settings").status_code == status
        page = http.get("/ui/glossary")
        assert page.status_code == 200
        assert ('href="/ui/settings"' in page.text) == (status == 200)


def test_the_glossary_has_each_state_and_answer_as_pages_say_them():
    said = {word for words in WORDS.values() for word in words}
    assert set(STATES.values()) <= said
    moved = alert_words.answers("drift")
    assert {answer.label for answer in moved} <= said
