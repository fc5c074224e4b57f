"""The HTTP interface: the application, its endpoints and the OpenAPI document."""
