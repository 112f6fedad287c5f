"""`fsoe-net init --list`: the library as people and programs read it."""

from __future__ import annotations

import json
from pathlib import Path

from cli.tool import fsn

import fsoe_net


def test_the_list_has_every_device_once():
    done = fsn("init", "--list")
    assert (done.returncode, done.stderr) == (0, "")
    files = sorted((Path(fsoe_net.__file__).parent / "devices").glob("*.yaml"))
    assert len(done.stdout.splitlines()) == len(files) + 3
    assert "EL6900               main      6 x 6/6" in done.stdout


def test_one_device_in_full():
    done = fsn("init", "--list", "el2904")
    assert done.returncode == 0
    for words in (
        "EL2904: vendor 0x00000002, product 0x0b583052",
        "0x1600: 7000:01/8 7001:01/1",
        "frame at byte 0: 6 bytes, 1 of them safe",
        "pfh_per_hour 1.25e-09",
        "unverified",
        "length and direction alone do not distinguish the two",
    ):
        assert words in done.stdout


def test_a_logic_without_process_data_names_where_they_are():
    done = fsn("init", "--list", "el6910")
    assert done.returncode == 0
    assert "Process data (MainInstance): made by its safety project" in done.stdout
    assert "Read them from the device" in done.stdout
    assert "EL6910               main      by project" in fsn("init", "--list").stdout


def test_json_has_places_sources_and_figures():
    document = json.loads(fsn("init", "--list", "EL1904", "--format", "json").stdout)
    (device,) = document["devices"]
    mapping = device["mappings"][0]
    assert device["identities"][0]["product_code"] == 0x07703052
    assert mapping["frames"][1] == {"sm": 3, "byte": 0, "frame_bytes": 6, "safe_bytes": 1}
    assert mapping["source"] in device["sources"]
    assert all(f["unverified"] for f in device["figures"])


def test_a_name_that_is_not_there_gets_a_hint():
    done = fsn("init", "--list", "EL1905")
    assert done.returncode == 2
    assert "Did you mean 'EL190" in done.stderr
    assert "`fsoe-net init` reads process data" in " ".join(done.stderr.split())


def test_an_own_file_with_a_mistake_is_refused_with_its_line(tmp_path: Path):
    library = Path(fsoe_net.__file__).parent / "devices"
    text = (library / "el2911.yaml").read_text("utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(text.replace("frame_bytes: 6", "frame_bytes: 8", 1), "utf-8")
    done = fsn("init", "--list", "EL2911", "--device-file", str(own))
    assert done.returncode == 1
    assert "own.yaml:" in done.stderr
    assert "FSN139" in done.stderr
    own.write_text(text.replace("EL2911", "EL29XX"), "utf-8")
    assert "EL29XX: vendor" in fsn("init", "--list", "el29xx", "--device-file", str(own)).stdout
