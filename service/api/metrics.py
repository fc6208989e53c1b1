"""`GET /metrics`, for Prometheus."""

from typing import Annotated

from fastapi import APIRouter, Header, Response
from prometheus_client.exposition import choose_encoder

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.schemas.metrics import MetricsCollector
from service.operations.metrics import load_metrics

router = APIRouter(tags=["operation"])

_FORMATS = dict.fromkeys(
    ("text/plain", "application/openmetrics-text"), {"schema": {"type": "string"}}
)


@router.get("/metrics", response_class=Response, responses={200: {"content": _FORMATS}})
def metrics(state: StateDep, session: ReadDep, accept: Annotated[str, Header()] = "") -> Response:
    """The metrics now, as Prometheus text or OpenMetrics."""
    encode, media_type = choose_encoder(accept)
    found = load_metrics(session, state.settings)
    text = encode(MetricsCollector(found, state.instruments.registry))
    return Response(text, media_type=media_type)
