"""One client's socket."""

import socket
import time

from weldsim.controller.connection import Connection


class Listener:
    """A session that keeps what it hears."""

    def __init__(self) -> None:
        self.heard = b""

    def greeting(self) -> bytes:
        return b"welcome\n"

    def ended(self) -> None:
        self.heard += b"."

    def received(self, data: bytes) -> bytes:
        self.heard += data
        return b"yes\n"


def connected() -> tuple[socket.socket, Connection, Listener]:
    """A client, the controller's end of it, and what listens there."""
    session = Listener()
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection(server.getsockname())
        sock, _ = server.accept()
    return client, Connection(sock, session), session


def test_last_words_of_a_client_that_hung_up_are_heard():
    """A program is sent, and the connection closed with the controller's packets unread: that resets it."""
    client, connection, session = connected()
    client.sendall(b"a program\n")
    client.close()
    end = time.monotonic() + 10
    while connection.open and time.monotonic() < end:
        connection.send(b"a packet")
    assert not connection.open
    assert session.heard == b"a program\n."
    connection.release()


def test_answers_come_after_the_greeting():
    client, connection, session = connected()
    client.sendall(b"are you there?\n")
    end = time.monotonic() + 10
    while not session.heard and time.monotonic() < end:
        connection.receive()
    connection.release()
    with client:
        assert client.makefile("rb").read() == b"welcome\nyes\n"
    assert session.heard == b"are you there?\n."
