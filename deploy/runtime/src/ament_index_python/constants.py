"""Names of the ament resource index."""

AMENT_PREFIX_PATH_ENV_VAR = "AMENT_PREFIX_PATH"
RESOURCE_INDEX_SUBFOLDER = "share/ament_index/resource_index"
"""The index within a prefix: a directory per type of resource, with a file per resource."""
