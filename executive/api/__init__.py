"""What every caller sees, here and over the network: codes, outcomes, events and operations."""

PORT = 8765  # default TCP port of a server
