"""The network: goals, events and the arm's lifecycle over HTTP, and rosbridge on a WebSocket."""
