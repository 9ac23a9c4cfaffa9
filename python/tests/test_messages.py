"""The messages built into the package are those of wire/proto/reloop.proto."""

import re
import unittest
from pathlib import Path

from reloop import messages

PROTO = Path(__file__).parents[2] / "wire" / "proto" / "reloop.proto"
RUST = PROTO.parents[1] / "src"
SERVICE = PROTO.with_name("service.proto")
HINT = "python -m reloop.messages wire/proto/*.proto"


def declared(text):
    """What a .proto declares: {message or enum: {field or value: (number, type, label)}}; nested ones by their path."""
    text = re.sub(r"//[^\n]*", "", text)
    found, path = {}, []
    for token in re.finditer(
        r"(message|enum|oneof)\s+(\w+)\s*\{|(\})|(?:(optional|repeated)\s+)?(?:\w+\.)*(\w+)\s+(\w+)\s*=\s*(\d+)\s*;|(\w+)\s*=\s*(\d+)\s*;",
        text,
    ):
        kind, name, closed, label, type_name, field, number, value, value_number = token.groups()
        if kind:
            path.append((kind, name))
            if kind != "oneof":
                found[".".join(n for k, n in path if k != "oneof")] = {}
        elif closed:
            path.pop()
        elif path:
            inside = found[".".join(n for k, n in path if k != "oneof")]
            one = path[-1][1] if path[-1][0] == "oneof" else None
            if field:
                inside[field] = (int(number), type_name, label, one)
            else:
                inside[value] = int(value_number)
    return found


def built_in(name):
    """The same of the descriptors that the package holds."""
    (file,) = messages.descriptor_set(name).file
    names = {
        1: "double",
        3: "int64",
        4: "uint64",
        5: "int32",
        8: "bool",
        9: "string",
        12: "bytes",
        13: "uint32",
        17: "sint32",
        18: "sint64",
    }
    found = {}

    def add_enum(enum, path):
        found[".".join([*path, enum.name])] = {value.name: value.number for value in enum.value}

    def add(message, path):
        path = [*path, message.name]
        fields = found[".".join(path)] = {}
        for field in message.field:
            label = "repeated" if field.label == field.LABEL_REPEATED else "optional" if field.proto3_optional else None
            real = field.HasField("oneof_index") and not field.proto3_optional
            one = message.oneof_decl[field.oneof_index].name if real else None
            type_name = names.get(field.type) or field.type_name.rsplit(".", 1)[1]
            fields[field.name] = (field.number, type_name, label, one)
        for nested in message.nested_type:
            add(nested, path)
        for enum in message.enum_type:
            add_enum(enum, path)

    for message in file.message_type:
        add(message, [])
    for enum in file.enum_type:
        add_enum(enum, [])
    return found


@unittest.skipUnless(PROTO.is_file(), f"no {PROTO}: this is not a checkout of the repository")
class MessagesTest(unittest.TestCase):
    maxDiff = None

    def test_each_field_has_the_number_type_and_label_of_the_proto(self):
        for proto in (PROTO, SERVICE):
            self.assertEqual(built_in(proto.stem), declared(proto.read_text()), f"write them anew: {HINT}")

    def test_the_descriptors_are_what_protoc_makes(self):
        for proto in (PROTO, SERVICE):
            try:
                made = messages.compiled(str(proto))
            except ImportError:
                self.skipTest("no grpcio-tools: pip install './python[test]'")
            self.assertEqual(messages.descriptor_set(proto.stem), made, f"write them anew: {HINT}")

    def test_the_version_is_the_sims(self):
        text = (RUST / "lib.rs").read_text()
        (version,) = re.findall(r"WIRE_VERSION: u32 = (\d+);", text)
        self.assertEqual(messages.WIRE_VERSION, int(version))
        text = (RUST / "keys" / "service.rs").read_text()
        (version,) = re.findall(r"SERVICE_VERSION: u32 = (\d+);", text)
        self.assertEqual(messages.SERVICE_VERSION, int(version))


if __name__ == "__main__":
    unittest.main()
