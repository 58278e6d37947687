"""The SBOM of an image: Debian or Ubuntu packages and Python distributions, as it lists them itself."""

import json
import shlex
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from cyclonedx.model.bom import Bom, BomMetaData
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output import make_outputter
from cyclonedx.schema import OutputFormat, SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packageurl import PackageURL

from common.errors import UserError
from release_program.running import run

_WITHIN_S: Final = 120.0
_DEBIAN_FIELDS: Final = "${Package}\\t${Version}\\t${Architecture}\\t${source:Package}\\n"
_DISTRIBUTIONS: Final = (
    "import importlib.metadata as m, json; "
    "print(json.dumps(sorted({(d.name, d.version) for d in m.distributions() if d.name})))"
)


def write_of_image(image: str, version: str, target: Path, epoch_s: int) -> None:
    """Writes the SBOM of an image as JSON, checked against CycloneDX's schema.

    Args:
        image: its name with the tag.
        version: of the release.
        target: the file to write.
        epoch_s: its time: seconds since 1970.

    Raises:
        UserError: the image can't be started, or lists what is no package.
    """
    name = image.partition(":")[0]
    packages = _inside(image, "dpkg-query", "--show", "--showformat", _DEBIAN_FIELDS)
    system = _inside(image, "cat", "/etc/os-release")
    distributions = _inside(image, "python", "-c", _DISTRIBUTIONS)
    components = [*debian_components(packages, system), *python_components(distributions)]
    target.write_text(document(name, version, components, epoch_s), encoding="utf-8")


def _inside(image: str, program: str, *words: str) -> str:
    return run(
        *(
            "docker",
            "run",
            "--rm",
            "--network",
            "none",
            "--read-only",
            "--entrypoint",
            program,
            image,
            *words,
        ),
        within_s=_WITHIN_S,
    )


def debian_components(listed: str, os_release: str) -> Iterator[Component]:
    """Yields the packages that dpkg-query has listed.

    Args:
        listed: a line for each: name, version, architecture and source package, separated by tabs.
        os_release: the text of /etc/os-release (os-release(5)).
    """
    system = {
        key: "".join(shlex.split(value))
        for key, equals, value in (line.partition("=") for line in os_release.splitlines())
        if equals
    }
    vendor = system.get("ID", "debian")
    release = f"{vendor}-{system['VERSION_ID']}" if "VERSION_ID" in system else vendor
    for line in listed.splitlines():
        name, version, architecture, source = _fields(line)
        qualifiers = {"arch": architecture, "distro": release, "upstream": source}
        purl = PackageURL("deb", vendor, name, version, qualifiers)
        yield Component(name=name, version=version, purl=purl, bom_ref=purl.to_string())


def _fields(line: str) -> tuple[str, str, str, str]:
    fields = line.split("\t")
    if len(fields) != 4 or not all(fields):
        raise UserError(f"dpkg-query listed {line!r}, which is no package")
    return fields[0], fields[1], fields[2], fields[3]


def python_components(listed: str) -> Iterator[Component]:
    """Yields the Python distributions, which are listed as a JSON array of [name, version]."""
    found: list[Any] = json.loads(listed)
    for name, version in found:
        purl = PackageURL("pypi", None, name.lower().replace("_", "-"), version)
        yield Component(name=name, version=version, purl=purl, bom_ref=purl.to_string())


def document(name: str, version: str, components: Iterable[Component], epoch_s: int) -> str:
    """Returns a CycloneDX 1.6 document; the same arguments give the same text.

    Raises:
        UserError: it does not match CycloneDX's schema.
    """
    main = Component(name=name, version=version, type=ComponentType.CONTAINER, bom_ref=f"{name}@{version}")
    bom = Bom(
        components=components,
        metadata=BomMetaData(component=main, timestamp=datetime.fromtimestamp(epoch_s, UTC)),
    )
    bom.register_dependency(main, list(bom.components))
    plain = json.loads(make_outputter(bom, OutputFormat.JSON, SchemaVersion.V1_6).output_as_string())
    # Drawn by chance, and not required.
    plain.pop("serialNumber", None)
    text = json.dumps(plain, indent=2, sort_keys=True) + "\n"
    if error := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
        raise UserError(f"the SBOM of {name} does not match CycloneDX's schema: {error}")
    return text
