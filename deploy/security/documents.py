"""The documents of DDS Security in a keystore, as SROS2 writes them: governance and permissions."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from datetime import datetime
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from deploy.security.rights import GRAPH, Rights, Rule

_SCHEMA = "http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_{}.xsd"
_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
_DOMAIN_RULES = {
    "allow_unauthenticated_participants": "false",
    "enable_join_access_control": "true",
    "discovery_protection_kind": "ENCRYPT",
    "liveliness_protection_kind": "ENCRYPT",
    "rtps_protection_kind": "SIGN",
}
_TOPIC_RULES = {
    "topic_expression": "*",
    "enable_discovery_protection": "true",
    "enable_liveliness_protection": "true",
    "enable_read_access_control": "true",
    "enable_write_access_control": "true",
    "metadata_protection_kind": "ENCRYPT",
    "data_protection_kind": "ENCRYPT",
}


def governance(domains: Iterable[int]) -> str:
    """Return the rules of all participants: only the authenticated join, and everything is encrypted."""
    root = _root("governance")
    rule = SubElement(SubElement(root, "domain_access_rules"), "domain_rule")
    _add_domains(rule, domains)
    _add(rule, _DOMAIN_RULES)
    _add(SubElement(SubElement(rule, "topic_access_rules"), "topic_rule"), _TOPIC_RULES)
    return _text(root)


def domains(text: str) -> set[int]:
    """Return the ROS domains that a governance names. Raises ValueError if it is none."""
    try:
        return {int(each.text or "") for each in ElementTree.fromstring(text).iterfind(".//domains/id")}
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from None


def permissions(
    enclave: str, rights: Rights, domains: Collection[int], validity: tuple[datetime, datetime]
) -> str:
    """Return what an enclave may do.

    :param validity: from when to when, in UTC.
    """
    root = _root("permissions")
    grant = SubElement(SubElement(root, "permissions"), "grant", name=enclave)
    begin, end = (time.replace(tzinfo=None).isoformat() for time in validity)
    _add(grant, {"subject_name": f"CN={enclave}"})
    _add(SubElement(grant, "validity"), {"not_before": begin, "not_after": end})
    for rule in (*rights, Rule(frozenset({GRAPH}), frozenset({GRAPH}))):
        _add_rule(grant, rule, domains)
    _add(grant, {"default": "DENY"})
    return _text(root)


def _root(document: str) -> Element:
    ElementTree.register_namespace("xsi", _INSTANCE)
    return Element("dds", {f"{{{_INSTANCE}}}noNamespaceSchemaLocation": _SCHEMA.format(document)})


def _add(parent: Element, values: dict[str, str]) -> None:
    for name, value in values.items():
        SubElement(parent, name).text = value


def _add_domains(rule: Element, domains: Iterable[int]) -> None:
    element = SubElement(rule, "domains")
    for domain in domains:
        SubElement(element, "id").text = str(domain)


def _add_rule(grant: Element, rule: Rule, domains: Iterable[int]) -> None:
    parent = SubElement(grant, "allow_rule" if rule.allows else "deny_rule")
    _add_domains(parent, domains)
    for direction, names in ("publish", rule.publish), ("subscribe", rule.subscribe):
        element = SubElement(SubElement(parent, direction), "topics")
        for name in sorted(names):
            SubElement(element, "topic").text = name


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"
