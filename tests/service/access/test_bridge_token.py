"""The token that `serve` makes for its bridge."""

from datetime import UTC, datetime

import pytest

from service.access.bridge_token import TOKEN_ID, renew_bridge_token
from service.access.tokens import caller_of_token, revoke_token
from service.commands.serve import run_service
from service.data_dir import StartError
from service.enums import TokenScope
from service.store import access
from tests.running import free_port


def renewed(store):
    with store.write() as session:
        return renew_bridge_token(session)


def caller(store, text):
    with store.read() as session:
        return caller_of_token(session, text)


def test_each_start_has_a_new_secret_and_the_same_token(store):
    first = renewed(store)
    found = caller(store, first)
    assert found.token_id == TOKEN_ID  # whose sources stay its own
    assert [found.may(scope) for scope in (TokenScope.READ, TokenScope.INGEST)] == [True, True]
    assert not found.may(TokenScope.OPERATE)
    second = renewed(store)
    assert caller(store, first) is None
    assert caller(store, second).token_id == TOKEN_ID
    with store.read() as session:
        (record,) = access.every(session)
        assert record.secret_sha256 not in first + second
        assert second.partition(f"{TOKEN_ID}_")[2] not in repr(vars(record))  # it may have a _ too


def test_what_somebody_has_revoked_stays_so(store):
    text = renewed(store)
    with store.write() as session:
        revoke_token(session, TOKEN_ID, "ada")
    assert renewed(store) is None
    assert caller(store, text) is None


def test_it_alone_is_no_way_in(store, settings):
    renewed(store)
    with store.read() as session:
        assert access.count_valid(session, datetime.now(UTC), besides=TOKEN_ID) == 0
    store.close()
    with pytest.raises(StartError, match="nobody has one"):
        run_service(settings.model_copy(update={"auth": "on", "port": free_port()}))
