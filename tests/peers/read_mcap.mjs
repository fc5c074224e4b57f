// The readers of Foxglove and Lichtblick: every message of the files, decoded by its own schema.
import { readFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";

async function read(path) {
  const bytes = readFileSync(path);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (at, length) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(at), Number(length)),
  };
  const decompressHandlers = await loadDecompressHandlers();
  const file = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const readers = new Map();
  for (const [id, schema] of file.schemasById) {
    readers.set(id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const reported = { counts: {}, frames: [], positions: [], attached: {} };
  for await (const message of file.readMessages({ validateCrcs: true })) {
    const channel = file.channelsById.get(message.channelId);
    const decoded = readers.get(channel.schemaId).readMessage(message.data);
    reported.counts[channel.topic] = (reported.counts[channel.topic] ?? 0) + 1;
    if (channel.topic === "/serial/tx") reported.frames.push(decoded.text);
    if (channel.topic === "/joint_states") reported.positions.push([...decoded.position]);
  }
  for await (const file_ of file.readAttachments({ validateCrcs: true })) {
    reported.attached[file_.name] = file_.data.length;
  }
  return { ...reported, indexed: Number(file.statistics.messageCount) };
}

const reported = [];
for (const path of process.argv.slice(2)) reported.push(await read(path));
console.log(JSON.stringify(reported));
