"""The HTTP interface: operations, answers and OpenAPI."""
