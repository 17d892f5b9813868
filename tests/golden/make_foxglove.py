"""Makes foxglove.json: the fields of Foxglove's messages, as foxglove-sdk 0.30.3 describes them.

It runs apart from the tests, where `foxglove-sdk` and `protobuf` are installed:
`python tests/golden/make_foxglove.py > tests/golden/foxglove.json`.
"""

from __future__ import annotations

import json
import sys

from foxglove import messages
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet

TYPES = {
    FieldDescriptorProto.TYPE_DOUBLE: "number",
    FieldDescriptorProto.TYPE_STRING: "string",
    FieldDescriptorProto.TYPE_BYTES: "string",
    FieldDescriptorProto.TYPE_BOOL: "boolean",
    FieldDescriptorProto.TYPE_FIXED32: "integer",
    FieldDescriptorProto.TYPE_ENUM: "integer",
}
TIMES = {".google.protobuf.Timestamp": "time", ".google.protobuf.Duration": "duration"}


def type_of(field):
    kind = TYPES.get(field.type) or TIMES.get(field.type_name) or field.type_name[1:]
    return [kind] if field.label == field.LABEL_REPEATED else kind


def main():
    found = {}
    for name in ("SceneUpdate", "FrameTransforms", "Log"):
        files = FileDescriptorSet()
        files.ParseFromString(getattr(messages, name).get_schema().data)
        for file in files.file:
            for message in file.message_type if file.package == "foxglove" else ():
                fields = {field.name: type_of(field) for field in message.field}
                found[f"foxglove.{message.name}"] = fields
    sys.stdout.write(json.dumps(found, indent=1, sort_keys=True) + "\n")


main()
