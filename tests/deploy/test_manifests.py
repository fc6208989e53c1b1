"""What runs many machines: the compose file and the Kubernetes example name what exists."""

import re

import pytest
import yaml
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from service.app import create_app
from service.cli import app
from service.settings import Settings
from tests.conftest import ROOT

FOLDER = ROOT / "deploy" / "postgresql"
COMPOSE, KUBERNETES = FOLDER / "compose.yaml", FOLDER / "kubernetes.yaml"
SETTINGS = {f"SUREFOOT_{name.upper()}" for name in Settings.model_fields}
SHARED = {"SUREFOOT_DATABASE_URL", "SUREFOOT_SECRET_KEY"}


def services():
    return yaml.safe_load(COMPOSE.read_text())["services"]


def documents():
    return {
        (document["kind"], document["metadata"]["name"]): document
        for document in yaml.safe_load_all(KUBERNETES.read_text())
    }


def pod(name):
    return documents()["Deployment", name]["spec"]["template"]["spec"]


def container(name):
    (only,) = pod(name)["containers"]
    return only


def environment(name):
    return {entry["name"]: entry["value"] for entry in container(name)["env"]}


@pytest.mark.parametrize("path", [COMPOSE, KUBERNETES])
def test_every_variable_is_a_setting(path):
    named = set(re.findall(r"SUREFOOT_[A-Z_]*[A-Z]", path.read_text()))
    assert named <= SETTINGS
    assert named >= SHARED


@pytest.mark.parametrize("name", ["surefoot-api", "surefoot-worker"])
def test_pods_get_no_variables_of_the_service_that_are_read_as_settings(name):
    """Kubernetes sets SUREFOOT_PORT=tcp://... for a Service of this name: no worker started."""
    service = documents()["Service", "surefoot"]["metadata"]["name"]
    with pytest.raises(ValueError, match="port"):
        Settings.model_validate({"port": "tcp://10.0.0.7:80"})
    assert f"{service.upper()}_PORT" in SETTINGS
    assert pod(name)["enableServiceLinks"] is False


def test_every_command_and_its_flags_are_real():
    commands = [services()[name]["command"] for name in ("api", "worker")]
    commands += [container(name)["command"] for name in ("surefoot-api", "surefoot-worker")]
    for program, command, *flags in commands:
        assert program == "surefoot"
        # A flag that is none is refused before any help is given.
        described = CliRunner().invoke(app, [command, *flags, "--help"])
        assert described.exit_code == 0, (command, flags)
    assert commands[0] == commands[2] == ["surefoot", "serve", "--workers", "0"]
    for path in (COMPOSE, KUBERNETES):
        assert "surefoot token add NAME --scope admin" in path.read_text()


def test_all_that_share_a_database_share_its_url_and_the_key():
    for name in ("api", "worker"):
        assert set(services()[name]["environment"]) >= SHARED
    for name in ("surefoot-api", "surefoot-worker"):
        assert container(name)["envFrom"] == [{"secretRef": {"name": "surefoot"}}]
        assert not set(environment(name)) & SHARED  # no secret stands in a manifest
    told = KUBERNETES.read_text()
    assert {f"--from-literal={name}=" for name in SHARED} <= set(
        re.findall(r"--from-literal=[A-Z_]+=", told)
    )


def test_containers_are_limited_and_come_back():
    for name, service in services().items():
        assert service["restart"] == "always", name
        assert service["mem_limit"], name
        assert service["cpus"], name
        assert "test" in service["healthcheck"] or name == "worker"
    for name in ("surefoot-api", "surefoot-worker"):
        resources = container(name)["resources"]
        assert set(resources["limits"]) == set(resources["requests"]) == {"cpu", "memory"}
        assert pod(name)["securityContext"]["runAsNonRoot"] is True
        assert container(name)["securityContext"]["readOnlyRootFilesystem"] is True
    build = services()["api"]["build"]["context"]
    assert (FOLDER / build / "Dockerfile").exists()


def test_what_is_mounted_can_be_written_by_the_images_user():
    (uid,) = re.findall(r"useradd .*--uid (\d+)", (ROOT / "Dockerfile").read_text())
    for name in ("surefoot-api", "surefoot-worker"):
        user = pod(name)["securityContext"]
        assert {user["runAsUser"], user["fsGroup"]} == {int(uid)}
        mounts = {mount["name"]: mount["mountPath"] for mount in container(name)["volumeMounts"]}
        assert {volume["name"] for volume in pod(name)["volumes"]} == set(mounts)
        # Not the mount itself, which is root's: the data directory's mode is narrowed.
        assert environment(name)["SUREFOOT_DATA_DIR"].startswith(f"{mounts['data']}/")


def test_the_service_leads_to_the_api():
    service = documents()["Service", "surefoot"]["spec"]
    deployment = documents()["Deployment", "surefoot-api"]["spec"]
    labels = deployment["template"]["metadata"]["labels"]
    assert service["selector"] == deployment["selector"]["matchLabels"] == labels
    (port,) = container("surefoot-api")["ports"]
    assert service["ports"][0]["targetPort"] == port["name"]
    assert str(port["containerPort"]) == environment("surefoot-api")["SUREFOOT_PORT"]
    assert environment("surefoot-api")["SUREFOOT_ALLOWED_HOSTS"] == "surefoot"
    (published,) = services()["api"]["ports"]
    assert published.endswith(f":{services()['api']['environment']['SUREFOOT_PORT']}")


def test_probes_ask_for_real_routes(settings):
    api = container("surefoot-api")
    probes = [api[name]["httpGet"] for name in ("startupProbe", "livenessProbe")]
    assert [probe["path"] for probe in probes] == ["/healthz", "/healthz"]
    assert {probe["port"] for probe in probes} == {api["ports"][0]["name"]}
    with TestClient(create_app(settings)) as http:
        assert http.get("/healthz").status_code == 200
        # No worker has ever lived: 503, and the pod takes posts all the same.
        answer = http.get("/readyz")
        assert (answer.status_code, answer.json()["store_writable"]) == (503, True)
    for command in (
        api["readinessProbe"]["exec"]["command"],
        services()["api"]["healthcheck"]["test"][1:],
    ):
        assert command[:2] == ["python", "-c"]
        compile(command[2], "probe", "exec")
        assert "http://127.0.0.1:8080/readyz" in command[2]
    assert '["store_writable"]' in api["readinessProbe"]["exec"]["command"][2]
