"""Environment variables that look like settings and have no effect."""

import pytest

from service.commands.settings_given import warn_of_variables
from service.settings import Settings, variables_without_effect


@pytest.mark.parametrize("name", Settings.model_fields)
def test_every_setting_without_its_prefix_is_named(name):
    """`SNAPSHOTS=pictures` did nothing, without a warning."""
    variable = name.upper()
    expected = {variable: f"SUREFOOT_{variable}"}
    assert variables_without_effect({variable: "x", "PATH": "/bin"}) == expected
    assert variables_without_effect({name: "x"}) == expected  # the prefix takes lower case, too
    assert variables_without_effect({variable: "x", f"SUREFOOT_{variable}": "y"}) == {}
    assert variables_without_effect({f"SUREFOOT_{variable}": "y"}) == {}


@pytest.mark.parametrize(
    ("variable", "meant"),
    [
        ("SUREFOOT_SNAPSHOT", "SUREFOOT_SNAPSHOTS"),
        ("SUREFOOT_KEEPDAYS", "SUREFOOT_KEEP_DAYS"),
        ("SUREFOOT_MQTT_URI", "SUREFOOT_MQTT_URL"),
        ("SUREFOOT_TIME_ZONE", "SUREFOOT_TIMEZONE"),
    ],
)
def test_misspelled_setting_is_named_with_the_right_one(variable, meant):
    assert variables_without_effect({variable: "x"}) == {variable: meant}


@pytest.mark.parametrize(
    "variable",
    ["HOME", "SUREFOOT_TOKEN", "SUREFOOT_URL", "SUREFOOT_TEST_SCENES", "SUREFOOT_SERVICE_HOST"],
)
def test_other_variables_are_no_settings(variable):
    assert variables_without_effect({variable: "x"}) == {}


def test_warning_names_both_variables_and_no_value(monkeypatch, caplog):
    for name in ("SNAPSHOTS", "SMTP_PASSWORD"):
        monkeypatch.setenv(name, "hunter2")
    warn_of_variables()
    named = {(each.variable, each.use) for each in caplog.records}
    expected = {(n, f"SUREFOOT_{n}") for n in ("SNAPSHOTS", "SMTP_PASSWORD")}
    assert expected <= named
    assert {each.levelname for each in caplog.records} == {"WARNING"}
    assert "hunter2" not in str([vars(each) for each in caplog.records])
