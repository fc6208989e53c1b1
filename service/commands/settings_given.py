"""The settings that a command is given: its flags, above its environment."""

import logging
import os
from typing import TYPE_CHECKING, Any

from service.logs import configure_logs
from service.workers.processes.process import be_private

if TYPE_CHECKING:
    from service.settings import Settings


log = logging.getLogger("surefoot.settings")


class WrongSettingsError(Exception):
    """Settings that cannot be; `lines` say which, what is needed, and what was given."""

    def __init__(self, lines: list[str]) -> None:
        super().__init__("; ".join(lines))
        self.lines = lines


def begin(**flags: Any) -> "Settings":
    """Settings of a command on a data directory, whose log and files are seen to from here on.

    Raises:
        WrongSettingsError: one of them cannot be.
    """
    configure_logs()
    be_private()
    return settings_given(**flags)


def warn_of_variables() -> None:
    """Log the environment variables that look like settings and have no effect, without values."""
    from service.settings import variables_without_effect

    for variable, meant in variables_without_effect(os.environ).items():
        log.warning("variable_without_effect", extra={"variable": variable, "use": meant})


def settings_given(**flags: Any) -> "Settings":
    """Settings of the environment, with the flags that are not None above them.

    Raises:
        WrongSettingsError: one of them cannot be.
    """
    # Pydantic takes two thirds of what the command line imports: `--help` does without.
    from pydantic import ValidationError

    from service.setting_values import wrong_settings
    from service.settings import Settings

    try:
        return Settings(**{name: value for name, value in flags.items() if value is not None})
    except ValidationError as error:
        raise WrongSettingsError(wrong_settings(error)) from error
