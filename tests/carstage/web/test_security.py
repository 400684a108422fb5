"""Who may speak to the server."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocketDisconnect

from carstage.web.limits import WorkLimit
from sites import Site, open_site

pytestmark = pytest.mark.xdist_group("web")  # one site for all

LIVE = "ws://127.0.0.1:8321/api/live"
TOKEN = "a-token-that-nobody-guesses"


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8321", "127.0.0.1.evil.example"])
def test_names_bent_to_loopback_are_refused(site: Site, host: str) -> None:
    answer = site.client.get("/api/config", headers={"Host": host})
    assert answer.status_code == 403
    assert set(answer.json()) == {"code", "message", "hint", "errors"}


@pytest.mark.parametrize("host", ["localhost:9", "127.0.0.1:1234", "[::1]:8321"])
def test_loopback_is_served_on_any_port_as_behind_a_tunnel(site: Site, host: str) -> None:
    assert site.client.get("/api/runs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_pages_of_other_origins_are_refused(site: Site, origin: str) -> None:
    answer = site.client.post("/api/preview/warm", headers={"Origin": origin})
    assert answer.status_code == 403


def test_the_own_page_is_served(site: Site) -> None:
    headers = {"Origin": "http://127.0.0.1:8321", "Sec-Fetch-Site": "same-origin"}
    assert site.client.get("/api/runs", headers=headers).status_code == 200


def test_pictures_are_not_for_other_pages(site: Site) -> None:
    headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}
    assert site.client.get("/api/runs", headers=headers).status_code == 403


@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Host": "evil.example"}])
def test_web_sockets_of_other_pages_are_refused(site: Site, headers: dict[str, str]) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        site.client.websocket_connect(LIVE, headers=headers),
    ):
        pass


def test_web_sockets_of_the_own_page_are_served(site: Site) -> None:
    headers = {"Origin": "http://127.0.0.1:8321"}
    with site.client.websocket_connect(LIVE, headers=headers) as socket:
        assert socket.receive_json()["type"] == "snapshot"


def test_every_answer_forbids_what_the_page_does_not_need(site: Site) -> None:
    headers = site.client.get("/api/nothing").headers
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"


def test_no_page_that_loads_scripts_from_elsewhere_is_served(site: Site) -> None:
    assert site.client.get("/docs").status_code == 404
    assert site.client.get("/redoc").status_code == 404


def test_beyond_loopback_nothing_answers_without_the_token(tmp_path: Path) -> None:
    with open_site(tmp_path, host="0.0.0.0", token=TOKEN) as client:
        for path in ("/", "/?token=wrong", "/api/config", "/api/openapi.json", "/assets/x.js"):
            answer = client.get(path, headers={"Host": "box.lan:8321"}, follow_redirects=False)
            assert answer.status_code == 403, path
            assert TOKEN not in answer.text
        with pytest.raises(WebSocketDisconnect), client.websocket_connect(LIVE):
            pass


def test_the_token_in_the_address_becomes_a_cookie_that_scripts_cannot_read(
    tmp_path: Path,
) -> None:
    with open_site(tmp_path, host="0.0.0.0", token=TOKEN) as client:
        welcome = client.get(f"/?token={TOKEN}", follow_redirects=False)
        assert welcome.status_code == 303
        assert "token" not in welcome.headers["location"]
        cookie = welcome.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=lax" in cookie  # the page may be opened from a file
        assert client.get("/api/runs").status_code == 200  # the client keeps the cookie
        with client.websocket_connect(LIVE) as socket:
            assert socket.receive_json()["type"] == "snapshot"
        refused = client.get("/api/runs", headers={"Origin": "http://evil.example"})
        assert refused.status_code == 403


def test_cookies_of_other_programs_lock_nobody_out(tmp_path: Path) -> None:
    with open_site(tmp_path, host="0.0.0.0", token=TOKEN) as client:
        given = client.get(f"/?token={TOKEN}", follow_redirects=False).headers["set-cookie"]
        own = given.split(";")[0]
        client.cookies.clear()
        for others in ('prefs={"theme":"dark"}', "theme=dark mode; seen", "seen", "user@x=1"):
            for line, status in ((others, 403), (f"{others}; {own}", 200)):
                answer = client.get("/api/runs", headers={"cookie": line})
                assert answer.status_code == status, line


def test_programs_give_the_token_as_bearer(tmp_path: Path) -> None:
    with open_site(tmp_path, host="0.0.0.0", token=TOKEN) as client:
        right = client.get("/api/runs", headers={"Authorization": f"Bearer {TOKEN}"})
        wrong = client.get("/api/runs", headers={"Authorization": "Bearer no"})
        assert (right.status_code, wrong.status_code) == (200, 403)


def test_a_client_has_no_more_than_so_many_requests_under_way() -> None:
    most, clients = 3, ("10.0.0.1", "10.0.0.2")
    sent: dict[str, list[int]] = {name: [] for name in clients}

    async def everything() -> None:
        go = asyncio.Event()

        async def work(scope: Any, receive: Any, send: Any) -> None:
            await go.wait()
            await send({"type": "http.response.start", "status": 200, "headers": []})

        limited = WorkLimit(work, most)

        async def ask(client: str) -> None:
            async def send(message: Any) -> None:
                if message["type"] == "http.response.start":
                    sent[client].append(message["status"])

            scope = {"type": "http", "client": (client, 1), "method": "GET", "headers": []}
            await limited(scope, None, send)  # type: ignore[arg-type]

        asked = [asyncio.create_task(ask(client)) for client in clients for _ in range(5)]
        await asyncio.sleep(0)
        assert sent == {name: [429, 429] for name in clients}
        go.set()
        await asyncio.gather(*asked)
        await ask(clients[0])

    asyncio.run(everything())
    assert sent == {clients[0]: [429, 429, *[200] * 4], clients[1]: [429, 429, *[200] * 3]}
