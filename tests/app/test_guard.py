"""Who may ask the server, and what it gives: its own page with its token, files of its folder."""

from __future__ import annotations

import http.client
import json
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser

PAGES = (
    "/",
    "/app.js",
    "/frame.js",
    "/transport.js",
    "/app.css",
    "/view.js",
    "/numbers.js",
    "/wasm/limbs",
)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Served]:
    with browser.served(tmp_path_factory.mktemp("served") / "project") as server:
        (server.folder / "mine.csv").write_text("x [mm]\n1\n")
        (server.folder / ".hidden").write_text("secret")
        (server.folder / "link").symlink_to("/etc/passwd")
        yield server


def ask(
    served: browser.Served,
    method: str,
    path: str,
    body: bytes | None = None,
    headers: dict[str, str] | None = None,
    token: bool = True,
) -> tuple[int, dict[str, str], bytes]:
    given = {"x-pkmcal-token": served.token} if token else {}
    # closed whatever happens: one that is left is found, and blamed on a test that runs later
    with closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=120)) as connection:
        connection.request(method, path, body, {**given, **(headers or {})})
        answer = connection.getresponse()
        return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()


def state(served: browser.Served) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(ask(served, "GET", "/api/state")[2])
    return found


@pytest.mark.parametrize("path", PAGES)
def test_pages_are_for_everybody_and_hold_no_secret(served: browser.Served, path: str) -> None:
    status, headers, body = ask(served, "GET", path, token=False)
    assert status == 200 and served.token.encode() not in body
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe-inline" not in policy
    assert "'unsafe-eval'" not in policy and "frame-ancestors 'none'" in policy
    assert headers["x-frame-options"] == "DENY" and headers["referrer-policy"] == "no-referrer"
    assert headers["x-content-type-options"] == "nosniff" and headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    "path", ["/api/state", "/api/events", "/api/health", "/api/download/mine.csv"]
)
@pytest.mark.parametrize("token", [None, "", "x", "é" * 8])
def test_nothing_is_given_without_the_token(
    served: browser.Served, path: str, token: str | None
) -> None:
    headers = {} if token is None else {"x-pkmcal-token": token.encode().decode("latin-1")}
    assert ask(served, "GET", path, headers=headers, token=False)[0] == 401


def test_a_token_in_the_address_or_in_a_cookie_is_none(served: browser.Served) -> None:
    assert ask(served, "GET", f"/api/state?t={served.token}", token=False)[0] == 401
    cookie = {"Cookie": f"x-pkmcal-token={served.token}"}
    assert ask(served, "GET", "/api/state", headers=cookie, token=False)[0] == 401


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "127.0.0.1",
        "localhost",
        "127.0.0.1:1",
        "[::1]:80",
        "0.0.0.0",
        "127.0.0.1.evil.example",
        "",
        "evil.example:{port}",
        "127.0.0.2:{port}",
    ],
)
def test_a_name_that_was_made_to_lead_here_is_refused(served: browser.Served, host: str) -> None:
    assert (
        ask(served, "GET", "/api/state", headers={"Host": host.format(port=served.port)})[0] == 421
    )
    assert ask(served, "GET", "/", headers={"Host": host.format(port=served.port)})[0] == 421


def test_two_hosts_are_refused(served: browser.Served) -> None:
    with socket.create_connection(("127.0.0.1", served.port), timeout=10) as connection:
        own = f"127.0.0.1:{served.port}"
        text = f"GET / HTTP/1.1\r\nHost: {own}\r\nHost: {own}\r\nConnection: close\r\n\r\n"
        connection.sendall(text.encode())
        assert connection.recv(100).split()[1] in (b"400", b"421")


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "https://localhost"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_another_origin_is_refused_even_with_the_token(
    served: browser.Served, headers: dict[str, str]
) -> None:
    for method, path in (("GET", "/api/state"), ("POST", "/api/state"), ("POST", "/api/run/fit")):
        assert ask(served, method, path, b"{}", headers)[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        "/etc/passwd",
        "..%2f..%2fetc%2fpasswd",
        "%2e%2e/x",
        "link",
        ".hidden",
        "mine.csv%00",
        "%00",
        "mine.csv/",
        "a/../../x",
        "....//x",
        "%5c..%5cx",
        "",
    ],
)
def test_no_way_leads_out_of_the_folder(served: browser.Served, path: str) -> None:
    status, _, body = ask(served, "GET", f"/api/download/{path}")
    assert status in (200, 307, 404) and b"root:" not in body and b"secret" not in body
    if status == 200:
        assert path.startswith("mine.csv")


def test_files_are_taken_away_and_never_shown(served: browser.Served) -> None:
    _, headers, body = ask(served, "GET", "/api/download/mine.csv")
    assert body == b"x [mm]\n1\n" and headers["content-type"] == "application/octet-stream"
    assert headers["content-disposition"].startswith("attachment")


@pytest.mark.parametrize(
    "name", ["../up.csv", "-rf.csv", "project.toml", "<img src=x>.csv", "a\x00b.csv", "é.csv"]
)
def test_files_that_are_sent_stay_in_the_folder(served: browser.Served, name: str) -> None:
    before = set(served.folder.parent.iterdir())
    status, _, body = ask(served, "PUT", f"/api/file/{quote(name, safe='')}", b"q1,x\n1,2\n")
    assert status == 200
    kept = json.loads(body)["name"]
    assert (served.folder / kept).read_bytes() == b"q1,x\n1,2\n" and kept != "project.toml"
    assert set(served.folder.parent.iterdir()) == before


def test_what_is_announced_too_large_is_refused(served: browser.Served) -> None:
    with socket.create_connection(("127.0.0.1", served.port), timeout=10) as connection:
        head = (
            f"PUT /api/file/big.csv HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
            f"x-pkmcal-token: {served.token}\r\nContent-Length: 200000000\r\n\r\n"
        )
        connection.sendall(head.encode())
        assert b" 413 " in connection.recv(200)


def test_half_a_file_leaves_nothing(served: browser.Served) -> None:
    with socket.create_connection(("127.0.0.1", served.port), timeout=10) as connection:
        head = (
            f"PUT /api/file/half.csv HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
            f"x-pkmcal-token: {served.token}\r\nContent-Length: 1000\r\n\r\nabc"
        )
        connection.sendall(head.encode())
    for _ in range(50):
        if not list(served.folder.glob(".*.part")):
            break
        time.sleep(0.1)
    assert not (served.folder / "half.csv").exists() and not list(served.folder.glob(".*.part"))


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b"[]",
        b"null",
        b'{"state": 1, "version": 1}',
        b"\xff",
        b'{"state": {"pkmcal-project": 1, "machine": {"file": "/etc/passwd"}}, "version": 1}',
    ],
)
def test_a_broken_state_is_refused_and_nothing_changes(served: browser.Served, body: bytes) -> None:
    before = state(served)
    assert ask(served, "POST", "/api/state", body)[0] in (400, 409)
    assert state(served)["state"] == before["state"]
    assert ask(served, "POST", "/api/state", b" " * 2_000_000)[0] == 413


@pytest.mark.parametrize("operation", ["__import__", "os", "run", "told", "../x", "%2e%2e"])
def test_no_other_work_can_be_asked_for(served: browser.Served, operation: str) -> None:
    assert ask(served, "POST", f"/api/run/{operation}", b"{}")[0] == 404


def test_of_two_tabs_the_second_is_told(served: browser.Served) -> None:
    now = state(served)
    table = {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}}
    body = json.dumps({"state": table, "version": now["version"]}).encode()
    assert ask(served, "POST", "/api/state", body)[0] == 200
    status, _, answer = ask(served, "POST", "/api/state", body)
    assert status == 409 and json.loads(answer)["state"] == table


def test_only_this_computer_is_listened_to(served: browser.Served) -> None:
    listening = subprocess.run(
        ["ss", "-ltnH", f"sport = :{served.port}"], capture_output=True, text=True, check=True
    ).stdout.split()
    assert listening[3] == f"127.0.0.1:{served.port}"


def test_what_leads_to_the_page_is_its_owners_alone(served: browser.Served) -> None:
    door = served.folder / ".open-pkmcal.html"
    assert door.stat().st_mode & 0o777 == 0o600 and served.token in door.read_text()
    command = Path(f"/proc/{served.process.pid}/cmdline").read_bytes()
    assert served.token.encode() not in command


METHODS = st.sampled_from(["GET", "POST", "PUT", "DELETE", "HEAD", "PATCH", "OPTIONS"])
PARTS = st.text(st.characters(min_codepoint=1, max_codepoint=0x2FF), max_size=12).map(
    lambda t: quote(t, safe="")
)
PATHS = st.lists(
    st.one_of(
        st.sampled_from(
            ["api", "state", "file", "run", "fit", "download", "cancel", "undo", "..", ""]
        ),
        PARTS,
    ),
    max_size=5,
)


@settings(
    max_examples=300, deadline=5000, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(method=METHODS, path=PATHS, body=st.binary(max_size=200))
def test_whatever_is_asked_the_server_answers_and_keeps_to_its_folder(
    served: browser.Served, method: str, path: list[str], body: bytes
) -> None:
    way = "/" + "/".join(path)
    if way.rstrip("/").endswith(("/events", "/run/fit", "/run/machine")):
        return  # streams that work
    assert ask(served, method, way, body)[0] < 500


@pytest.mark.parametrize(
    "given",
    [{}, {"files": 3}, {"files": ["../x"]}, {"files": ["/etc/passwd"]}, {"files": [None]},
     {"files": ["project.toml\0"]}, {"files": [".open-pkmcal.html"]}, {"files": [{}]}],
)  # fmt: skip
def test_only_files_of_the_folder_are_taken(served: browser.Served, given: object) -> None:
    lines = ask(served, "POST", "/api/run/take", json.dumps(given).encode())[2].splitlines()
    error = json.loads(lines[-1])["error"]
    assert "fault" not in error and "crashed" not in error
