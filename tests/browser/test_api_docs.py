"""The viewer of the API works where there is no internet, under the policy of all pages."""

import pytest

from tests.browser.conftest import shoot

pytestmark = pytest.mark.slow


@pytest.mark.nightly
def test_operations_show_open_and_are_tried(page):
    # The fixture fails on a request to another host, a script's error or a breach of the policy.
    page.goto("/docs")
    page.locator(".opblock").first.wait_for()
    described = page.evaluate("fetch('/openapi.json').then((answer) => answer.json())")
    operations = sum(len(methods) for methods in described["paths"].values())
    assert page.locator(".opblock").count() == operations
    healthz = page.locator(".opblock", has=page.locator("[data-path='/healthz']"))
    healthz.locator(".opblock-summary-control").click()
    healthz.get_by_role("button", name="Try it out").click()
    healthz.get_by_role("button", name="Execute").click()
    answer = healthz.locator(".live-responses-table .response-col_status").last
    answer.wait_for()
    assert "200" in answer.inner_text()
    page.get_by_role("button", name="Authorize").first.click()
    page.locator(".auth-container input").first.wait_for()
    page.wait_for_timeout(500)  # whatever it would ask another host for, it has asked by now
    shoot(page, "api_docs")
