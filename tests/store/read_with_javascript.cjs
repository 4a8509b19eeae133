// Reads a log with @mcap/core, through its index and as a stream, and decodes every message; prints what it saw.
"use strict";
const fs = require("node:fs/promises");
const path = require("node:path");
const { createRequire } = require("node:module");

const [modules, file] = process.argv.slice(2);
const load = createRequire(path.join(path.resolve(modules), "here.js"));
const { McapIndexedReader, McapStreamReader } = load("@mcap/core");
const { loadDecompressHandlers } = load("@mcap/support");
const protobufjs = load("protobufjs");
const { FileDescriptorSet } = load("protobufjs/ext/descriptor");

const count = (counts, topic) => { counts[topic] = (counts[topic] ?? 0) + 1; };

async function main() {
  const data = await fs.readFile(file);
  const decompressHandlers = await loadDecompressHandlers();
  const readable = {
    size: async () => BigInt(data.length),
    read: async (offset, size) => new Uint8Array(data.subarray(Number(offset), Number(offset + size))),
  };

  const indexed = {}, decoders = new Map();
  let smallest = Infinity, twist;
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  for await (const record of reader.readMessages()) {
    const channel = reader.channelsById.get(record.channelId);
    if (!decoders.has(channel.id)) {
      const schema = reader.schemasById.get(channel.schemaId);
      const root = protobufjs.Root.fromDescriptor(FileDescriptorSet.decode(schema.data));
      decoders.set(channel.id, root.lookupType(schema.name));
    }
    const message = decoders.get(channel.id).decode(record.data);
    count(indexed, channel.topic);
    if (channel.topic === "/margins") {
      for (const contact of message.contacts) smallest = Math.min(smallest, contact.margin);
    }
    if (channel.topic === "/pusher/twist") twist = { vx: message.vx, vy: message.vy, omega: message.omega };
  }
  const attachments = [], metadata = [];
  for await (const attachment of reader.readAttachments()) attachments.push(attachment.name);
  for await (const record of reader.readMetadata()) metadata.push(record.name);

  const streamed = {}, topics = new Map();
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(new Uint8Array(data));
  for (let record; (record = stream.nextRecord()); ) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type === "Message") count(streamed, topics.get(record.channelId));
  }
  if (!stream.done()) throw new Error("the stream reader did not reach the end");
  process.stdout.write(JSON.stringify(
    { indexed, streamed, attachments, metadata, smallest_margin: smallest, last_twist: twist }));
}

main().catch((error) => { console.error(error); process.exit(1); });
