"""`/webhooks` and `/deliveries`: endpoints, their secrets, the log of what was sent, replay."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas.webhooks import (
    DeliveryList,
    DeliveryOut,
    SecretOut,
    WebhookBody,
    WebhookList,
    WebhookMade,
    WebhookOut,
    WebhookPatch,
)
from service.enums import DeliveryState
from service.notifications import webhooks
from service.notifications.webhooks import WebhookSpec

router = APIRouter(tags=["webhooks"])


def checked_body(body: WebhookBody, state: StateDep) -> WebhookBody:
    """The body, whose URL was checked while no transaction is open: resolvers may be slow."""
    webhooks.require_url(state.settings, body.url)
    return body


def checked_patch(body: WebhookPatch, state: StateDep) -> WebhookPatch:
    """The same of a change."""
    if body.url is not None:
        webhooks.require_url(state.settings, body.url)
    return body


CheckedBody = Annotated[WebhookBody, Depends(checked_body)]
CheckedPatch = Annotated[WebhookPatch, Depends(checked_patch)]


@router.post("/webhooks", status_code=201)
def create(
    body: CheckedBody, state: StateDep, session: WriteDep, response: Response
) -> WebhookMade:
    """Create a webhook. Its secret is in this answer and in no other."""
    made = webhooks.create_webhook(
        session,
        state.settings,
        WebhookSpec(
            url=body.url,
            name=body.name,
            kinds=None if body.kinds is None else tuple(body.kinds),
            format=body.format,
            enabled=body.enabled,
        ),
    )
    response.headers["Location"] = f"/webhooks/{made.record.id}"
    return WebhookMade.from_made(made)


@router.get("/webhooks")
def list_all(session: ReadDep) -> WebhookList:
    """Webhooks, oldest first."""
    return WebhookList(
        items=[WebhookOut.from_value(view) for view in webhooks.list_webhooks(session)]
    )


@router.get("/webhooks/{webhook_id}")
def show(webhook_id: str, session: ReadDep) -> WebhookOut:
    """A webhook, and how it fares."""
    return WebhookOut.from_value(webhooks.show_webhook(session, webhook_id))


@router.patch("/webhooks/{webhook_id}")
def change(webhook_id: str, body: CheckedPatch, state: StateDep, session: WriteDep) -> WebhookOut:
    """Change a webhook; with another URL, or enabled again, it is sent what waits for it."""
    changes = body.model_dump(exclude_unset=True)
    return WebhookOut.from_value(webhooks.change_webhook(session, state.queue, webhook_id, changes))


@router.delete("/webhooks/{webhook_id}", status_code=204)
def remove(webhook_id: str, session: WriteDep) -> None:
    """Delete a webhook with its deliveries."""
    webhooks.remove_webhook(session, webhook_id)


@router.post("/webhooks/{webhook_id}/secret")
def rotate(webhook_id: str, state: StateDep, session: WriteDep) -> SecretOut:
    """Give a webhook a new secret; for a day, messages are signed with the old one, too."""
    made = webhooks.rotate_secret(session, state.settings, webhook_id)
    return SecretOut.model_validate(
        {"secret": made.secret, "old_secret_until": made.record.old_secret_until}
    )


@router.post("/webhooks/{webhook_id}/test", status_code=202)
def test(webhook_id: str, session: WriteDep) -> DeliveryOut:
    """Queue a message of the type `test`."""
    return DeliveryOut.from_value(webhooks.test_webhook(session, webhook_id))


@router.get("/webhooks/{webhook_id}/deliveries")
def list_deliveries(
    webhook_id: str,
    session: ReadDep,
    state: DeliveryState | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> DeliveryList:
    """What was sent or is to be, newest first, with every attempt."""
    views = webhooks.list_deliveries(session, webhook_id, state, limit)
    return DeliveryList(items=[DeliveryOut.from_value(view) for view in views])


@router.get("/deliveries/{delivery_id}")
def show_delivery(delivery_id: str, session: ReadDep) -> DeliveryOut:
    """A delivery with its attempts."""
    return DeliveryOut.from_value(webhooks.show_delivery(session, delivery_id))


@router.post("/deliveries/{delivery_id}/replay", status_code=202)
def replay(delivery_id: str, state: StateDep, session: WriteDep) -> DeliveryOut:
    """Send a delivery anew, at once and under the same `webhook-id`."""
    return DeliveryOut.from_value(webhooks.replay_delivery(session, state.queue, delivery_id))
