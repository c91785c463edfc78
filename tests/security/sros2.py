"""What SROS2 0.13 (ROS 2 Jazzy) makes, recorded: `create_keystore`, and `create_enclave` for /talker."""

from __future__ import annotations

KEYSTORE = {
    "public/ca.cert.pem": "",
    "public/identity_ca.cert.pem": "ca.cert.pem",
    "public/permissions_ca.cert.pem": "ca.cert.pem",
    "private/ca.key.pem": "",
    "private/identity_ca.key.pem": "ca.key.pem",
    "private/permissions_ca.key.pem": "ca.key.pem",
    "enclaves/governance.xml": "",
    "enclaves/governance.p7s": "",
}
"""The target of each link; '' for a file."""
ENCLAVE = {
    "enclaves/talker/cert.pem": "",
    "enclaves/talker/key.pem": "",
    "enclaves/talker/permissions.xml": "",
    "enclaves/talker/permissions.p7s": "",
    "enclaves/talker/governance.p7s": "../governance.p7s",
    "enclaves/talker/identity_ca.cert.pem": "../../public/identity_ca.cert.pem",
    "enclaves/talker/permissions_ca.cert.pem": "../../public/permissions_ca.cert.pem",
}
CA_SUBJECT = "CN=sros2CA"
SUBJECT = "CN=/talker"
DAYS_BEFORE, DAYS_AFTER = 1, 3650
"""The validity of a certificate, from its making."""
SIGNED = (
    "MIME-Version: 1.0",
    'Content-Type: multipart/signed; protocol="application/x-pkcs7-signature"; micalg="sha-256"',
)
"""How a signed document begins."""

_SCHEMA = (
    "{http://www.w3.org/2001/XMLSchema-instance}noNamespaceSchemaLocation",
    "http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_",
)
GOVERNANCE = [
    ("dds", (_SCHEMA[0], f"{_SCHEMA[1]}governance.xsd"), ""),
    ("domain_access_rules", (), ""),
    ("domain_rule", (), ""),
    ("domains", (), ""),
    ("id", (), "7"),
    ("allow_unauthenticated_participants", (), "false"),
    ("enable_join_access_control", (), "true"),
    ("discovery_protection_kind", (), "ENCRYPT"),
    ("liveliness_protection_kind", (), "ENCRYPT"),
    ("rtps_protection_kind", (), "SIGN"),
    ("topic_access_rules", (), ""),
    ("topic_rule", (), ""),
    ("topic_expression", (), "*"),
    ("enable_discovery_protection", (), "true"),
    ("enable_liveliness_protection", (), "true"),
    ("enable_read_access_control", (), "true"),
    ("enable_write_access_control", (), "true"),
    ("metadata_protection_kind", (), "ENCRYPT"),
    ("data_protection_kind", (), "ENCRYPT"),
]
"""The elements of governance.xml in document order: name, attribute, text."""
PERMISSIONS = [
    ("dds", (_SCHEMA[0], f"{_SCHEMA[1]}permissions.xsd"), ""),
    ("permissions", (), ""),
    ("grant", ("name", "/talker"), ""),
    ("subject_name", (), "CN=/talker"),
    ("validity", (), ""),
    ("not_before", (), "BEGIN"),
    ("not_after", (), "END"),
    ("allow_rule", (), ""),
    ("domains", (), ""),
    ("id", (), "7"),
    ("publish", (), ""),
    ("topics", (), ""),
    ("topic", (), "rt/chatter"),
    ("topic", (), "rt/rosout"),
    ("subscribe", (), ""),
    ("topics", (), ""),
    ("topic", (), "rt/clock"),
    ("allow_rule", (), ""),
    ("domains", (), ""),
    ("id", (), "7"),
    ("publish", (), ""),
    ("topics", (), ""),
    ("topic", (), "ros_discovery_info"),
    ("subscribe", (), ""),
    ("topics", (), ""),
    ("topic", (), "ros_discovery_info"),
    ("default", (), "DENY"),
]
"""Those of permissions.xml for a policy that publishes chatter and rosout, and reads clock."""
