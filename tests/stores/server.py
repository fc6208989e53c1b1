"""A PostgreSQL server of the tests' own: in a temporary folder, by an unprivileged user."""

import os
import pwd
import shutil
import subprocess
import tempfile
from pathlib import Path

import psycopg

SWITCH, SERVER = "SUREFOOT_TEST_DATABASE", "SUREFOOT_TEST_SERVER"
_NOBODY = "nobody"
# In memory a new database takes 20 ms, on a disk 300: it is some 600 files, and each test has one.
_IN_MEMORY, _NEEDED_B = Path("/dev/shm"), 4 << 30
_FOUND = {
    "shared_buffers": "64MB",
    "max_connections": "300",
    "listen_addresses": "",
    "log_min_messages": "fatal",
}
# Nothing of it outlives the run: what makes a database survive a power cut is left off.
_HASTE = {
    "fsync": "off",
    "synchronous_commit": "off",
    "full_page_writes": "off",
    "autovacuum": "off",
}


def wanted() -> bool:
    """Whether tests are to run on PostgreSQL."""
    chosen = os.environ.get(SWITCH, "sqlite")
    if chosen not in ("sqlite", "postgresql"):
        raise ValueError(f"{SWITCH}: sqlite or postgresql is needed, got {chosen}")
    return chosen == "postgresql"


def programs() -> Path | None:
    """The folder of initdb and pg_ctl, the newest if there are several; None without any."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda p: int(p.parts[-3]))
    if found:
        return found[-1].parent
    on_path = shutil.which("initdb")
    return None if on_path is None else Path(on_path).parent


def _where() -> Path | None:
    """A folder in memory, if there is one with room enough; else None, for a temporary one."""
    if _IN_MEMORY.is_dir() and shutil.disk_usage(_IN_MEMORY).free > _NEEDED_B:
        return _IN_MEMORY
    return None


class Server:
    """A cluster that is made, started, and thrown away.

    One that is `durable` lies on a disk and makes sure of each commit, as servers usually do.
    """

    def __init__(self, *, durable: bool = False) -> None:
        bin_folder = programs()
        if bin_folder is None:
            raise RuntimeError("no PostgreSQL here: apt-get install postgresql")
        self._bin = bin_folder
        self.folder = Path(
            tempfile.mkdtemp(prefix="surefoot-postgresql-", dir=None if durable else _where())
        )
        self._options = _FOUND if durable else {**_FOUND, **_HASTE}
        self._user = _NOBODY if os.getuid() == 0 else None
        if self._user is not None:
            who = pwd.getpwnam(self._user)
            os.chown(self.folder, who.pw_uid, who.pw_gid)

    @property
    def data(self) -> Path:
        return self.folder / "data"

    @property
    def pid(self) -> int:
        return int((self.data / "postmaster.pid").read_text().split()[0])

    def url(self, name: str = "postgres") -> str:
        return f"postgresql://postgres@/{name}?host={self.folder}"

    def start(self) -> None:
        if not self.data.exists():
            self._run("initdb", "-D", self.data, "-U", "postgres", "-A", "trust", "--no-sync",
                      "-E", "UTF8", "--locale=C.UTF-8")  # fmt: skip
            lines = [f"{name} = '{value}'" for name, value in self._options.items()]
            lines.append(f"unix_socket_directories = '{self.folder}'")
            with (self.data / "postgresql.auto.conf").open("a") as file:
                file.write("\n".join(lines) + "\n")
        self._run("pg_ctl", "-D", self.data, "-l", self.folder / "log", "-w", "start")

    def stop(self, mode: str = "immediate") -> None:
        self._run("pg_ctl", "-D", self.data, "-m", mode, "-w", "stop")

    def remove(self) -> None:
        self.stop()
        shutil.rmtree(self.folder)

    def _run(self, program: str, *arguments: object) -> None:
        done = subprocess.run(
            [self._bin / program, *map(str, arguments)],
            user=self._user,
            extra_groups=[] if self._user else None,
            cwd="/",
            # No pipe: the server would hold it open.
            stdout=subprocess.DEVNULL,
            stderr=subprocess.STDOUT,
            check=False,
        )
        if done.returncode:
            log = self.folder / "log"
            said = log.read_text() if log.exists() else f"status {done.returncode}"
            raise RuntimeError(f"{program}: {said}")


def ask(url: str, *statements: str) -> None:
    """Run statements outside of transactions."""
    with psycopg.connect(url, autocommit=True) as connection:
        for statement in statements:
            connection.execute(statement)


def named(server: str, name: str) -> str:
    """The URL of another database of the same server."""
    return server.replace("/postgres?", f"/{name}?")


def make(server: str, name: str, template: str = "template1") -> str:
    """A new database like another one, to which nobody is connected from now on; its URL."""
    ask(
        server,
        f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{template}'",
        f'DROP DATABASE IF EXISTS "{name}" WITH (FORCE)',
        f'CREATE DATABASE "{name}" TEMPLATE "{template}" STRATEGY FILE_COPY',
    )
    return named(server, name)


def drop(server: str, name: str) -> None:
    """Throw a database away, whoever is connected to it."""
    ask(server, f'DROP DATABASE IF EXISTS "{name}" WITH (FORCE)')
