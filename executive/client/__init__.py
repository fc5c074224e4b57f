"""Use a server from Python: `with Client() as arm: arm.run(1)`, or AsyncClient with `await`."""
