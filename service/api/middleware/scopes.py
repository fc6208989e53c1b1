"""Scopes that routes need, in one place; a test fails for a route that is not here."""

import re
from collections import defaultdict

from starlette.routing import compile_path

from service.api.middleware.pages import VIEWER_SCRIPT_URL, VIEWER_STYLE_URL
from service.enums import TokenScope

# None: whoever asks.
Need = TokenScope | None

_ROUTES: dict[Need, tuple[str, ...]] = {
    # `/readyz` tells an orchestrator whether to send work here; what is wrong, only who may read.
    None: (
        "GET /client.py",
        "GET /healthz",
        "GET /readyz",
        "GET /ui/login",
        "POST /ui/language",
        "POST /ui/login",
    ),
    TokenScope.INGEST: ("POST /cameras/{camera_id}/tracks", "PUT /bridges/{bridge}"),
    TokenScope.READ: (
        "GET /",
        "GET /activity",
        "GET /alerts",
        "GET /alerts/{alert_id}",
        "GET /alerts/{alert_id}/evidence",
        "GET /cameras",
        "GET /cameras/{camera_id}",
        "GET /cameras/{camera_id}/maintenance",
        "GET /cameras/{camera_id}/pose",
        "GET /cameras/{camera_id}/pose.yaml",
        "GET /cameras/{camera_id}/pose/history",
        "GET /cameras/{camera_id}/sources",
        "GET /cameras/{camera_id}/trainings",
        "GET /cameras/{camera_id}/hints",
        "GET /cameras/{camera_id}/zones",
        "GET /docs",
        "GET /events",
        "GET /handovers",
        "GET /metrics",
        "GET /openapi.json",
        "GET /reports/weekly",
        "GET /trainings/{training_id}",
        "GET /ui/alerts",
        "GET /ui/cameras/{camera_id}",
        "GET /ui/cameras/{camera_id}/posts",
        "GET /ui/fleet/banners",
        "GET /ui/fleet/index",
        "GET /ui/fleet/rows",
        "GET /ui/glossary",
        "GET /ui/handover",
        "GET /ui/health",
        "GET /ui/health/banner",
        "GET /ui/map",
        "GET /ui/report",
        "GET /ui/wall",
        "GET /wall",
        f"GET {VIEWER_SCRIPT_URL}",
        f"GET {VIEWER_STYLE_URL}",
        "POST /cameras/{camera_id}/ground",
        "POST /cameras/{camera_id}/image",
        "POST /ui/logout",
    ),
    TokenScope.OPERATE: (
        "POST /actions",
        "POST /alerts/{alert_id}/acknowledge",
        "POST /alerts/{alert_id}/resolve",
        "POST /alerts/{alert_id}/silence",
        "POST /cameras/{camera_id}/maintenance",
        "PATCH /cameras/{camera_id}/maintenance/{window_id}",
        "DELETE /cameras/{camera_id}/maintenance/{window_id}",
        "POST /cameras/{camera_id}/pose/accept",
        "POST /cameras/{camera_id}/pose/confirm",
        "POST /cameras/{camera_id}/pose/put-back",
        "POST /cameras/{camera_id}/pose/undo",
        "POST /cameras/{camera_id}/reference/reset",
        "POST /cameras/{camera_id}/sources/{source:path}/use",
        "DELETE /cameras/{camera_id}/sources/{source:path}",
        "PUT /cameras/{camera_id}/hints",
        "PUT /cameras/{camera_id}/zones",
        "GET /cameras/{camera_id}/snapshot",
        "POST /cameras/{camera_id}/aim",
        "GET /ui/cameras/{camera_id}/aim",
        "PUT /cameras/{camera_id}/snapshot",
        "DELETE /cameras/{camera_id}/snapshot",
        "GET /cameras/{camera_id}/plan",
        "PUT /cameras/{camera_id}/plan",
        "DELETE /cameras/{camera_id}/plan",
        "POST /cameras/{camera_id}/trainings",
        "POST /handovers",
        "POST /handovers/{handover_id}/take",
        "DELETE /trainings/{training_id}",
    ),
    # Addresses of webhooks often hold a secret; the form and the list of tokens are for who may
    # use them.
    TokenScope.ADMIN: (
        "GET /deliveries/{delivery_id}",
        "GET /tokens",
        "GET /ui/register",
        "GET /ui/settings",
        "GET /ui/tokens",
        "GET /ui/webhooks",
        "GET /webhooks",
        "GET /webhooks/{webhook_id}",
        "GET /webhooks/{webhook_id}/deliveries",
        "POST /calibrations",
        "POST /cameras",
        "PATCH /cameras/{camera_id}",
        "DELETE /cameras/{camera_id}",
        "POST /deliveries/{delivery_id}/replay",
        "POST /tokens",
        "DELETE /tokens/{token_id}",
        "POST /ui/calibration",
        "POST /ui/preview",
        "POST /ui/register",
        "POST /ui/tokens",
        "POST /ui/tokens/{token_id}/revoke",
        "POST /ui/tracks",
        "POST /webhooks",
        "PATCH /webhooks/{webhook_id}",
        "DELETE /webhooks/{webhook_id}",
        "POST /webhooks/{webhook_id}/secret",
        "POST /webhooks/{webhook_id}/test",
    ),
}
NEEDS: dict[tuple[str, str], Need] = {
    (method, path): need
    for need, routes in _ROUTES.items()
    for method, path in map(str.split, routes)
}
# A path without parameters is only what it says, before those that fit it, too.
_PLAIN: dict[tuple[str, str], Need] = {
    each: need for each, need in NEEDS.items() if "{" not in each[1]
}
# By method and by what the path begins with: each request is looked for.
_PATTERNS: defaultdict[tuple[str, str], list[tuple[re.Pattern[str], Need]]] = defaultdict(list)
for (_method, _path), _need in sorted(NEEDS.items(), key=lambda item: item[0][1].count("{")):
    if "{" in _path:
        _PATTERNS[_method, _path.split("/")[1]].append((compile_path(_path)[0], _need))


def need_of(method: str, path: str) -> tuple[Need, dict[str, str]]:
    """The scope that a request needs, and the parameters of its path.

    What is not declared needs most: `read` to be told that there is nothing, else `admin`.
    """
    method = "GET" if method == "HEAD" else method
    if (method, path) in _PLAIN:
        return _PLAIN[method, path], {}
    first = path[1:].partition("/")[0]
    for pattern, need in _PATTERNS.get((method, first), ()):
        match = pattern.match(path)
        if match is not None:
            return need, match.groupdict()
    return (TokenScope.READ if method == "GET" else TokenScope.ADMIN), {}
