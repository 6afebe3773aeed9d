"""The page's server: who may enter, what a slow viewer gets, what rubbish does."""

import asyncio
import json
import urllib.error
import urllib.request

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from oarlock.live.server import MOST_AT_ONCE, MOST_RUBBISH, PageServer
from oarlock.storage.errors import DataError

FILES = {"/": b"<!doctype html><title>live</title>", "/live.js": b"1"}


def served(work, **keys):
    """Runs `work(server)` beside a server."""
    commands = []

    def command(told):
        commands.append(told)
        return None if told["do"] == "note" else f"'{told['do']}' is unknown"

    async def run():
        server = PageServer(FILES, command, lambda: {"type": "hello"}, **keys)
        await server.start()
        try:
            return await asyncio.wait_for(work(server), 60)
        finally:
            await server.stop()

    return asyncio.run(run()), commands


def socket_url(server, token=None):
    token = server.token if token is None else token
    return f"ws://127.0.0.1:{server.port}/live" + (f"?token={token}" if token else "")


async def got(socket):
    return json.loads(await socket.recv())


def fetched(url):
    try:
        with urllib.request.urlopen(url) as answer:
            return answer.status, dict(answer.headers), answer.read()
    except urllib.error.HTTPError as error:
        return error.code, dict(error.headers), error.read()


def test_the_page_and_nothing_else_is_served_and_runs_only_its_own_script():
    async def work(server):
        return [
            await asyncio.to_thread(fetched, server.url + path) for path in ("", "live.js", "../etc/passwd")
        ]

    (page, script, other), _ = served(work)
    assert (page[0], page[2]) == (200, FILES["/"])
    assert page[1]["Content-Type"].startswith("text/html")
    assert "script-src 'self'" in page[1]["Content-Security-Policy"]
    assert "unsafe" not in page[1]["Content-Security-Policy"]
    assert script[0] == 200 and script[1]["Content-Type"].startswith("text/javascript")
    assert other[0] == 404


def test_a_viewer_that_stalls_gets_the_newest_frame_next():
    async def work(server):
        async with connect(socket_url(server)) as quick, connect(socket_url(server)) as stalled:
            assert await got(quick) == await got(stalled) == {"type": "hello"}
            for number in range(1000):
                server.publish({"type": "frame", "number": number})
                assert (await got(quick))["frame"]["number"] == number
                await quick.send('{"shown": 1}')
            server.announce({"type": "event", "text": "seat is silent"})
            first = await got(stalled)
            event = await got(stalled)
            await stalled.send('{"shown": 1}')
            last = await got(stalled)
            assert [viewer.skipped for viewer in server.viewers] == [0, 998]
            return first["frame"]["number"], event["text"], last["frame"]["number"]

    assert served(work)[0] == (0, "seat is silent", 999)


@pytest.mark.parametrize("given", ["", "wrong", "t0k"])
def test_without_the_token_there_is_neither_page_nor_socket(given):
    async def work(server):
        page = await asyncio.to_thread(fetched, f"http://127.0.0.1:{server.port}/?token={given}")
        with pytest.raises(InvalidStatus) as refused:
            await connect(socket_url(server, given or ""))
        async with connect(socket_url(server)) as socket:
            assert await got(socket) == {"type": "hello"}
        return page[0], refused.value.response.status_code, server.refused

    assert served(work, token="t0ken")[0] == (403, 403, 2)


def test_a_page_of_another_site_may_not_connect():
    async def work(server):
        with pytest.raises(InvalidStatus) as refused:
            await connect(socket_url(server), origin="http://elsewhere.example")
        async with connect(socket_url(server), origin=f"http://127.0.0.1:{server.port}") as socket:
            assert await got(socket) == {"type": "hello"}
        return refused.value.response.status_code

    assert served(work)[0] == 403


RUBBISH = ["", "{", "[]", "7", '"do"', '{"do": 3}', "[" * 9000, b"\xff\x00", '{"other": 1}']


def test_rubbish_is_answered_and_ends_only_its_own_connection():
    async def work(server):
        async with connect(socket_url(server)) as good, connect(socket_url(server)) as bad:
            await got(good), await got(bad)
            for message in RUBBISH:
                await bad.send(message)
                assert (await got(bad))["type"] == "problem"
            await bad.send('{"do": "dance"}')
            assert "dance" in (await got(bad))["text"]
            with pytest.raises(ConnectionClosed):
                for _ in range(MOST_RUBBISH + 1):
                    await bad.send("x")
                    await got(bad)
            await good.send('{"do": "note", "text": "start"}')
            server.publish({"type": "frame"})
            assert (await got(good))["frame"] == {"type": "frame"}

    _, commands = served(work)
    assert commands == [{"do": "dance"}, {"do": "note", "text": "start"}]


def test_a_message_that_is_too_long_ends_its_connection():
    async def work(server):
        async with connect(socket_url(server)) as bad:
            await got(bad)
            await bad.send("x" * 100_000)
            with pytest.raises(ConnectionClosed):
                await got(bad)

    served(work)


def test_ten_viewers_all_get_frames():
    async def work(server):
        sockets = [await connect(socket_url(server)) for _ in range(10)]
        for socket in sockets:
            await got(socket)
        for number in range(20):
            server.publish({"type": "frame", "number": number})
            for socket in sockets:
                assert (await got(socket))["frame"]["number"] == number
                await socket.send('{"shown": 1}')
        for socket in sockets:
            await socket.close()

    served(work)


def test_a_port_that_is_taken_is_refused_by_name():
    async def work(server):
        second = PageServer(FILES, lambda _: None, dict, port=server.port)
        with pytest.raises(DataError, match=rf"{server.port}.*--port"):
            await second.start()

    served(work)


def test_the_address_for_others_has_their_way_here_and_the_token():
    async def work(server):
        return server.url, server.url_at("192.168.1.5"), server.port

    (here, there, port), _ = served(work, host="0.0.0.0", token="a&b")
    assert here == f"http://127.0.0.1:{port}/?token=a%26b"
    assert there == f"http://192.168.1.5:{port}/?token=a%26b"


def test_a_viewer_that_floods_the_session_with_notes_is_left_out():
    async def work(server):
        async with connect(socket_url(server)) as flood, connect(socket_url(server)) as other:
            await got(flood), await got(other)
            with pytest.raises(ConnectionClosed):
                for number in range(20_000):
                    await flood.send(json.dumps({"do": "note", "text": str(number)}))
                await flood.wait_closed()
                await flood.send("{}")
            await other.send(json.dumps({"do": "note", "text": "other"}))
            await asyncio.sleep(0.1)

    _, commands = served(work)
    texts = [command["text"] for command in commands]
    # A few more come in while the flood lasts.
    assert MOST_AT_ONCE <= len(texts) < 3 * MOST_AT_ONCE
    assert texts[:30] == [str(number) for number in range(30)] and texts[-1] == "other"
