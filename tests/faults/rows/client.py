"""Clients of a server, and what other programs at its address may do to them."""

import socket
import threading

from tests.faults.row import Scene, row


@row(
    "token-address",
    "another user's program listens at other addresses of the machine, with the server's port",
    "`--server http://localhost:PORT` reaches the server; the other program never gets the token",
    times=3,
    quick=1,
)
def token_address(scene: Scene) -> None:
    server = scene.serve()
    port = server.address[1]
    heads: list[bytes] = []

    def listen(listener: socket.socket) -> None:
        while True:
            connection, _ = listener.accept()
            with connection:
                heads.append(connection.recv(65_536))
                connection.sendall(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\n{}")

    with (
        socket.create_server(("::1", port), family=socket.AF_INET6) as six,
        socket.create_server(("127.0.0.2", port)) as four,
    ):
        for each in (six, four):
            threading.Thread(target=listen, args=(each,), daemon=True).start()
        for host in ("localhost", "127.0.0.1"):
            status = scene.armtree("status", "--server", f"http://{host}:{port}")
            scene.check(status.wait() == 0, f"{host}: exit status {status.wait()}")
        scene.check(not heads, "a command connected to another program")
        for host in ("[::1]", "127.0.0.2"):
            scene.armtree("cancel", "--server", f"http://{host}:{port}").wait()
        scene.check(len(heads) == 2, f"{len(heads)} requests reached the other program, not 2")
        token = server.token.encode()
        scene.check(not any(token in head for head in heads), "it was sent the token")
