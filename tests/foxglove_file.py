"""Reads an MCAP file of Protobuf messages by the descriptors in it, with the stock reader.

Nothing in here knows foxglove-sdk or the coordinator.
"""

import io
from typing import Any, NamedTuple

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader


class Found(NamedTuple):
    """A message of the file; times in ns."""

    topic: str
    schema: str
    log_time: int
    publish_time: int
    message: Any


def message_class(name, descriptors):
    """The class of the messages that a serialized FileDescriptorSet calls by this name."""
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(descriptors).file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


def messages_of(data):
    """Every message in the bytes of a file, in the order in which they stand there."""
    classes, found = {}, []
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
        if schema.id not in classes:
            classes[schema.id] = message_class(schema.name, schema.data)
        read = classes[schema.id].FromString(message.data)
        assert read.SerializeToString(deterministic=True) == message.data
        times = message.log_time, message.publish_time
        found.append(Found(channel.topic, schema.name, *times, read))
    return found
