"""Services to copy from; the manifest does not start them."""
