"""The bill of materials of the JavaScript in the pages, from the lock file of viewer/; the wheel contains it."""

import json
from typing import Any

from release.project import ROOT, version

BILL = ROOT / "release/javascript.cdx.json"
LOCK = ROOT / "viewer/package-lock.json"
# Bundles and what is in them, as in BUNDLES of viewer/build.mjs. esbuild builds and is in none.
BUNDLES = {
    "oarlock/report/viewer/player.js": ("three", "uplot"),
    "oarlock/live/page/live.js": ("three",),
}


def bill() -> dict[str, Any]:
    """CycloneDX 1.5; without a date or a serial number, so that the same input gives the same file."""
    packages = json.loads(LOCK.read_text(encoding="utf-8"))["packages"]
    names = sorted({name for inside in BUNDLES.values() for name in inside})
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": {
                "type": "library",
                "bom-ref": "oarlock-pages",
                "name": "oarlock-pages",
                "version": version(),
            }
        },
        "components": [_component(name, packages[f"node_modules/{name}"]) for name in names],
        "dependencies": [{"ref": "oarlock-pages", "dependsOn": [_purl(name, packages) for name in names]}],
    }


def text() -> str:
    """The file."""
    return json.dumps(bill(), indent=2) + "\n"


def _purl(name: str, packages: dict[str, Any]) -> str:
    return f"pkg:npm/{name}@{packages[f'node_modules/{name}']['version']}"


def _component(name: str, locked: dict[str, str]) -> dict[str, Any]:
    purl = f"pkg:npm/{name}@{locked['version']}"
    places = [{"location": bundle} for bundle, inside in BUNDLES.items() if name in inside]
    return {
        "type": "library",
        "bom-ref": purl,
        "name": name,
        "version": locked["version"],
        "licenses": [{"license": {"id": locked["license"]}}],
        "purl": purl,
        "evidence": {"occurrences": places},
    }
