"""The operator's page: hold-to-run switch, state, protocol and web server."""
