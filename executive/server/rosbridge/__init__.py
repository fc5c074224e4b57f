"""rosbridge: goals and topics over a WebSocket."""
