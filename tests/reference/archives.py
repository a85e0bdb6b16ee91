"""Changes of .gonio files: what is damaged in them is to be refused by name."""

import io
import json
import zipfile

import numpy as np


def rewritten(path, change):
    """The file with its entries changed: {name: bytes} -> {name: bytes}."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in change(entries).items():
            archive.writestr(name, data)


def with_fields(**fields):
    def change(entries):
        manifest = json.loads(entries["gonio.json"]) | fields
        return entries | {"gonio.json": json.dumps(manifest)}

    return change


def without(name):
    return lambda entries: {k: v for k, v in entries.items() if k != name}


def with_array(name, change):
    def changed(entries):
        buffer = io.BytesIO()
        np.save(buffer, np.ascontiguousarray(change(np.load(io.BytesIO(entries[f"{name}.npy"])))))
        return entries | {f"{name}.npy": buffer.getvalue()}

    return changed


def first(value):
    """The array with its first number changed."""

    def change(array):
        array = array.copy()
        array.flat[0] = value
        return array

    return change
