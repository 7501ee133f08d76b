"""Credits of a glTF file in Dublin Core, as KHR_xmp_json_ld.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_xmp_json_ld
https://www.dublincore.org/specifications/dublin-core/dcmi-terms/
https://www.dublincore.org/specifications/dublin-core/dcmi-point/
"""

from __future__ import annotations

from typing import Any

from exporters.asset import Asset

EXTENSION = "KHR_xmp_json_ld"
NAMESPACES = {
    "dc": "http://purl.org/dc/elements/1.1/",
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "xmp": "http://ns.adobe.com/xap/1.0/",
}


def packet(asset: Asset) -> dict[str, Any]:
    """Return the packet of an asset: title, rights, source, place, and the creator tool.

    It has no dc:creator: a credit line may name a publisher, a library or a licence as well.
    """
    facts: dict[str, Any] = {"@context": NAMESPACES, "@id": "", "dc:title": _in_any_language(asset.name)}
    if asset.copyright:
        facts["dc:rights"] = _in_any_language(asset.copyright)
    source = asset.metadata.get("source")
    if isinstance(source, str) and source:
        facts["dc:source"] = source
    if asset.placement is not None:
        place = asset.placement
        # DCMI Point: degrees on WGS 84 by default.
        facts["dc:coverage"] = (
            f"east={place.lon_deg!r}; north={place.lat_deg!r}; elevation={place.height_m!r}; "
            "zunits=metres above the ellipsoid of WGS 84"
        )
    facts["xmp:CreatorTool"] = "fig2mesh"
    return facts


def _in_any_language(text: str) -> dict[str, Any]:
    return {"@type": "rdf:Alt", "rdf:_1": {"@language": "x-default", "@value": text}}
