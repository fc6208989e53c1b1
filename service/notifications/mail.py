"""Mail by a server that the settings name, over TLS unless they say otherwise."""

import smtplib
import ssl
from contextlib import closing, suppress
from datetime import datetime
from email.message import EmailMessage
from email.utils import format_datetime

from service.setting_values import read_addresses
from service.settings import Settings

_TIMEOUT_S = 30.0
_PORTS = {"starttls": 587, "tls": 465, "off": 25}


def send_mail(
    settings: Settings, subject: str, text: str, message_id: str, made_at: datetime
) -> str | None:
    """Hand a mail over; says who was refused, None where nobody was.

    A mail that is sent again has the same `Message-ID`, by which mailboxes know it.

    Raises:
        OSError: the server was not reached, or took it for nobody.
    """
    mail = EmailMessage()
    mail["Subject"], mail["From"] = subject, settings.report_from
    mail["To"] = ", ".join(read_addresses(settings.report_to))
    mail["Date"] = format_datetime(made_at)
    mail["Message-ID"] = f"<{message_id}@{settings.report_from.rpartition('@')[2]}>"
    mail["Auto-Submitted"] = "auto-generated"
    mail.set_content(text)
    with closing(_connected(settings)) as server:
        refused = server.send_message(mail)
        with suppress(OSError):  # it was taken, however that ends
            server.quit()
    return f"refused: {', '.join(sorted(refused))}" if refused else None


def _connected(settings: Settings) -> smtplib.SMTP:
    host = settings.smtp_host or ""
    port = settings.smtp_port or _PORTS[settings.smtp_tls]
    trust = ssl.create_default_context()
    if settings.smtp_tls == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(host, port, timeout=_TIMEOUT_S, context=trust)
    else:
        server = smtplib.SMTP(host, port, timeout=_TIMEOUT_S)
    try:
        if settings.smtp_tls == "starttls":
            server.starttls(context=trust)
        if settings.smtp_user is not None:
            server.login(settings.smtp_user, settings.smtp_password or "")
    except BaseException:
        server.close()
        raise
    return server
