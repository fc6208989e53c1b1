"""What one camera or one caller holds does not keep the others from being served."""

import socket
import threading
import time
from contextlib import ExitStack, closing

import httpx
import pytest

from service.access import tokens
from service.access.tokens import TokenSpec
from service.api.middleware.admission import Shares
from service.errors import TooManyRequestsError
from service.store import cameras
from service.store.engines.store import Store
from service.store.pictures import PictureReferenceRecord
from tests.conftest import CAMERA, track
from tests.running import served, wait_for
from tests.service.api.test_connections import everything
from tests.service.conftest import problem

TAKES_IMAGES = {"snapshots": "features", "snapshot_allow": "127.0.0.0/8", "camera_rate": 0.0}


@pytest.fixture
def stack():
    with ExitStack() as made:
        yield made


def aimed_at(api, listening, camera_id):
    """A camera whose aim is computed from the image of a host."""
    url = f"http://127.0.0.1:{listening.getsockname()[1]}/now.jpg"
    body = {**CAMERA, "id": camera_id, "snapshot_url": url}
    api.http.post("/cameras", json=body).raise_for_status()
    with closing(Store(api.settings)) as store, store.write() as session:
        prior = cameras.prior_pose(session, camera_id)
        reference = {"camera_id": camera_id, "prior_pose_id": prior.id, "features": b"unread"}
        session.add(PictureReferenceRecord(**reference))


def in_background(what, *given):
    thread = threading.Thread(target=what, args=given, daemon=True)
    thread.start()
    return thread


def statuses_of_posts(api, camera_id, count=20):
    answers = []
    for number in range(count):
        body = {"tracks": [track(str(number))]}
        answers.append(api.http.post(f"/cameras/{camera_id}/tracks", json=body).status_code)
    return answers


@pytest.mark.slow
def test_aims_at_silent_cameras_keep_no_tracks_out(tmp_path, migrated, stack):
    """Twelve of them held all places of writers for 15 s, and every post got a 503."""
    with served(tmp_path, migrated, **TAKES_IMAGES, http_wait_s=1.0) as api:
        silent = [
            stack.enter_context(closing(socket.create_server(("127.0.0.1", 0)))) for _ in range(12)
        ]
        for number, listening in enumerate(silent):
            aimed_at(api, listening, f"c{number}")
        answers = []

        def aim(number):
            answers.append(httpx.post(f"{api.url}/cameras/c{number}/aim", timeout=30))

        aims = [in_background(aim, number) for number in range(12)]
        silent[0].settimeout(10)
        held = silent[0].accept()[0]  # the first one waits for its camera
        begun_s = time.monotonic()
        assert statuses_of_posts(api, "c0") == [202] * 20
        assert time.monotonic() - begun_s < 3  # meanwhile they wait
        document = problem(api.http.post("/cameras/c0/aim"), 429, "too_many_requests")
        assert document["detail"] == "aims: at most 1 at once for camera c0"
        for each in aims:
            each.join(20)
        held.close()
        details = sorted(each.json()["detail"][:30] for each in answers)
        assert details[-1] == "snapshot_url: no whole image w"
        assert {each.status_code for each in answers} <= {422, 503}
        # From now on the silent camera costs nothing: it is not asked.
        begun_s = time.monotonic()
        again = problem(api.http.post("/cameras/c0/aim"), 422, "malformed")
        assert "did not answer; the next request is in" in again["detail"]
        assert time.monotonic() - begun_s < 1


@pytest.mark.slow
def test_images_wait_for_one_another_and_keep_no_tracks_out(tmp_path, migrated):
    """Forty images that were expensive to decode held all places of writers."""
    from tests.service.cameras.test_snapshots import JPEG, scans

    heavy = scans(2560, 1440, 2_000)
    with served(tmp_path, migrated, **TAKES_IMAGES, http_wait_s=2.0) as api:
        api.http.post("/cameras", json=CAMERA).raise_for_status()

        def put():
            url = f"{api.url}/cameras/corner/snapshot"
            httpx.put(url, content=heavy, headers=JPEG, timeout=30)

        images = [in_background(put) for _ in range(12)]
        time.sleep(0.5)
        assert statuses_of_posts(api, "corner") == [202] * 20
        assert any(each.is_alive() for each in images)
        for each in images:
            each.join(20)


def test_one_token_does_not_take_all_streams(tmp_path, migrated, stack):
    """Those of one `read` token left none for an admin."""
    with served(tmp_path, migrated, max_streams=8, auth="off") as api:
        with closing(Store(api.settings)) as store, store.write() as session:
            reader, admin = (
                tokens.make_token(session, TokenSpec(name=scope, scopes=(scope,)), None).text
                for scope in ("read", "admin")
            )
        api.start_again(auth="on")

        def ask(token):
            made = socket.create_connection(("127.0.0.1", api.settings.port), timeout=10)
            stack.enter_context(closing(made))
            words = "GET /events HTTP/1.1", "Host: localhost", "Connection: close"
            head = "\r\n".join((*words, f"Authorization: Bearer {token}\r\n\r\n"))
            made.sendall(head.encode())
            answer = made.recv(65536)
            return made, answer if answer[9:12] == b"200" else answer + everything(made)

        opened = [ask(reader) for _ in range(8)]
        assert [answer[9:12] for _, answer in opened] == [b"200"] * 2 + [b"429"] * 6
        assert b"cache-control: no-store\r\n" in opened[0][1]
        assert b"streams: at most 2 at once for token" in opened[-1][1]
        assert ask(admin)[1][9:12] == b"200"
        opened[0][0].close()
        wait_for(lambda: ask(reader)[1][9:12] == b"200", 10)


def test_share_is_given_back_whatever_ends_it():
    shares = Shares("streams", 2)
    with (
        shares.place("ada"),
        shares.place("ada"),
        shares.place("bob"),
        pytest.raises(TooManyRequestsError, match="streams: at most 2 at once for ada"),
    ):
        shares.place("ada").__enter__()
    with pytest.raises(ZeroDivisionError), shares.place("ada"):
        _ = 1 / 0
    with shares.place("ada"), shares.place("ada"):
        pass
    assert not shares._held
